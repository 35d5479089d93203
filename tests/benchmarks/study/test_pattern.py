"""The expected pattern is judged by numbers: real runs show it, and what is doctored against it does not."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks.study import StudyResult
from kinqp.benchmarks.study.outcomes import joint_torques, standing_ticks
from kinqp.benchmarks.study.outcomes_table import outcome_tests
from kinqp.benchmarks.study.pattern import AT_LIMIT, Verdict, at_limit, hard_stop, verdicts


def judged(study: StudyResult) -> dict[str, Verdict]:
    return {one.key: one for one in verdicts(study, outcome_tests(study.trials))}


def doctored(study: StudyResult, letter: str, **columns: object) -> StudyResult:
    """Return the study with other values in some columns of an algorithm's trials."""
    hers = pl.col("algorithm") == letter
    changed = [
        pl.when(hers).then(pl.lit(value)).otherwise(pl.col(name)).cast(study.trials.schema[name]).alias(name)
        for name, value in columns.items()
    ]
    return replace(study, trials=study.trials.with_columns(changed))


def test_real_runs_show_the_pattern(study: StudyResult) -> None:
    found = judged(study)
    assert set(found) == {
        "A-slides", "A-peaks", "B-smooth", "B-freezes", "C-slides", "C-smooth", "C-never-exceeds", "C-gentler",
        "times", "C-expected", "sound",
    }  # fmt: skip
    for key in ("A-slides", "A-peaks", "B-smooth", "B-freezes", "C-slides", "C-smooth", "C-never-exceeds"):
        assert found[key].holds, found[key]


def test_the_hard_stop_loses_all_speed_in_one_period(study: StudyResult) -> None:
    peak, share, speed = hard_stop(study.runs["A"], 3)
    assert share == pytest.approx(1.0, abs=1e-6)
    assert peak == pytest.approx(speed / study.settings.dt)
    assert peak > 2.0 * study.settings.qdd_max[3]
    # C arrives with what its limit allows, which is a small share of its speed.
    peak, share, _ = hard_stop(study.runs["C"], 3)
    assert peak <= study.settings.qdd_max[3] * (1.0 + 1e-9)
    assert share < 0.9


def test_all_reach_the_limit_and_only_b_stands_there(study: StudyResult) -> None:
    settings = study.settings
    for letter, run in study.runs.items():
        on = at_limit(run, 3, settings.q_min[3], settings.q_max[3])
        assert on.any()
        assert np.all(np.abs(run.q[on, 3] - settings.q_min[3]) <= AT_LIMIT)
        assert standing_ticks(run).any() == (letter == "B")


@pytest.mark.parametrize(
    ("key", "letter", "columns"),
    [
        ("A-slides", "A", {"stops": 1}),
        ("A-peaks", "A", {"elbow_peak_qdd": 9.0}),
        ("B-smooth", "B", {"elbow_peak_qdd": 10.1}),
        ("B-freezes", "B", {"stops": 0}),
        ("B-freezes", "B", {"standing": 0.0}),
        ("C-slides", "C", {"stops": 2}),
        ("C-smooth", "C", {"elbow_peak_qdd": 10.1}),
        ("C-never-exceeds", "C", {"peak_qdd": 10.1}),
        ("C-gentler", "C", {"peak_torque_rate": 1e9}),
        ("times", "B", {"time": 0.1}),
        ("times", "C", {"time": 9.0}),
        ("C-expected", "C", {"unexpected": 1}),
        ("sound", "A", {"finished": False}),
        ("sound", "B", {"unsolved": 1}),
    ],
)
def test_a_verdict_can_fail(study: StudyResult, key: str, letter: str, columns: dict[str, object]) -> None:
    assert judged(doctored(study, letter, **columns))[key].holds is False


def test_what_does_not_reach_the_limit_is_not_judged(study: StudyResult) -> None:
    settings = replace(study.settings, q_min=(-3.0,) * 7)
    assert judged(replace(study, settings=settings))["C-slides"].holds is None


def test_a_run_that_does_not_move_at_the_limit_does_not_slide(study: StudyResult) -> None:
    run = study.runs["C"]
    still = replace(run, twist=np.zeros_like(run.twist))
    assert judged(replace(study, runs={**study.runs, "C": still}))["C-slides"].holds is False


def test_times_that_cannot_be_compared(study: StudyResult) -> None:
    same = study.trials.with_columns(pl.lit(5.0).alias("time"))
    assert judged(replace(study, trials=same))["times"].holds is None


def test_torques_are_those_of_the_dynamics(study: StudyResult) -> None:
    """A second opinion: mass matrix and bias forces, where the study uses the recursive algorithm."""
    run = study.runs["A"]
    at = np.linspace(0, len(run.t) - 1, 7).astype(int)
    expected = [
        run.robot.mass_matrix(run.q[k]) @ run.acceleration()[k] + run.robot.bias_forces(run.q[k], run.qd[k]) for k in at
    ]
    np.testing.assert_allclose(joint_torques(run)[at], expected, rtol=1e-9, atol=1e-9)
