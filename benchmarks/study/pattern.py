"""What the thesis's experiment is expected to show of A, B and C, and whether the measurements say so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import polars as pl

from .outcomes_table import operator_medians, values_of
from .words import number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...control import GuidedRun
    from .outcomes_table import OutcomeTest
    from .result import StudyResult

    Array = NDArray[np.float64]

# How close to its limit the joint counts as being at it [rad]: a hard stop leaves it up to one tick's motion short.
AT_LIMIT: Final = np.deg2rad(0.1)
# A limit counts as kept up to this share: rounding in a difference of commands.
_ROUNDING: Final = 1e-6
# The hard stop takes a tick: what the peak is of the speed lost over the period, at least and at most.
_STOP_SHARE: Final = (0.9, 1.1)
# An arm that slides on does so for at least this share of the time that its joint is at the limit.
_SLIDING: Final = 0.5
# Slower than this the tool does not slide [m/s].
_SLOW: Final = 1e-3
# Times that differ by up to this share are about as long.
_ALIKE: Final = 0.1
LEVEL: Final = 0.05


@dataclass(frozen=True)
class Verdict:
    """One expectation and what was measured.

    Attributes
    ----------
    key : str
    letter : str
        Algorithm that it is about.
    expected : str
        In words.
    measured : str
        In numbers.
    holds : bool or None
        None where it could not be judged.
    """

    key: str
    letter: str
    expected: str
    measured: str
    holds: bool | None


def verdicts(found: StudyResult, tests: Sequence[OutcomeTest]) -> tuple[Verdict, ...]:
    """Judge the expected pattern (thesis, sections 5.1 and 5.3) by a study's numbers.

    Parameters
    ----------
    found : StudyResult
        With algorithms A, B and C.
    tests : sequence of OutcomeTest
        Of its outcomes.
    """
    trials = found.trials
    limit = found.settings.qdd_max[found.settings.elbow]
    return (
        _slides(found, "A"),
        _hard_stop(found),
        _smooth(trials, "B", limit, "B approaches the limit smoothly: its elbow never exceeds its acceleration limit"),
        _freezes(trials),
        _slides(found, "C"),
        _smooth(trials, "C", limit, "C approaches the limit smoothly: its elbow never exceeds its acceleration limit"),
        _all_joints(found),
        _gentler(trials),
        _same_time(tests),
        _expected_motion(trials),
        _sound(trials),
    )


def at_limit(run: GuidedRun, joint: int, q_min: float, q_max: float) -> NDArray[np.bool_]:
    """Ticks at which a joint is within `AT_LIMIT` of one of its limits, shape (N,)."""
    q = run.q[:, joint]
    on: NDArray[np.bool_] = (q <= q_min + AT_LIMIT) | (q >= q_max - AT_LIMIT)
    return on


def _middle(values: Array) -> float:
    """Median that occurred, as in the table of medians: of an even number, the lower of the two in the middle."""
    return float(np.sort(values)[(len(values) - 1) // 2])


def _slides(found: StudyResult, letter: str) -> Verdict:
    settings, run = found.settings, found.runs[letter]
    elbow = settings.elbow
    on = at_limit(run, elbow, settings.q_min[elbow], settings.q_max[elbow])
    expected = f"{letter} slides along the limit without stopping"
    stops = values_of(found.trials, "stops", algorithm=letter)
    standing = values_of(found.trials, "standing", algorithm=letter)
    told = (
        f"{np.count_nonzero(stops == 0)} of {len(stops)} trials without a stop; still for {_middle(standing):.2f} s "
        "in the median trial"
    )
    if not on.any():
        return Verdict(f"{letter}-slides", letter, expected, f"{told}; the elbow did not reach its limit", None)
    moving = float(np.mean(np.linalg.norm(run.twist[on, :3], axis=1) > _SLOW))
    measured = f"{told}; in the trial shown the tool moves during {100 * moving:.0f} % of the time at the limit"
    holds = _middle(stops) == 0.0 and moving >= _SLIDING
    return Verdict(f"{letter}-slides", letter, expected, measured, holds)


def _hard_stop(found: StudyResult) -> Verdict:
    run, elbow = found.runs["A"], found.settings.elbow
    peak, share, speed = hard_stop(run, elbow)
    limit = found.settings.qdd_max[elbow]
    peaks = values_of(found.trials, "elbow_peak_qdd", algorithm="A")
    measured = (
        f"in the trial shown {peak:.0f} rad/s² where the elbow moved with {speed:.3f} rad/s one period before: "
        f"{share:.2f} v/dt; median of all trials {_middle(peaks):.0f} rad/s², {_middle(peaks) / limit:.0f} times "
        "the limit"
    )
    holds = _STOP_SHARE[0] <= share <= _STOP_SHARE[1] and _middle(peaks) > limit
    return Verdict("A-peaks", "A", "A stops hard: its elbow acceleration peaks at about v/dt", measured, holds)


def hard_stop(run: GuidedRun, joint: int) -> tuple[float, float, float]:
    """Peak acceleration of a joint [rad/s^2], its share of v/dt, and that v: the speed one tick before [rad/s].

    The share is 1 where all speed is lost within one period, and 0 where there was none.
    """
    acceleration = run.acceleration()[:, joint]
    tick = int(np.argmax(np.abs(acceleration)))
    speed = abs(float(run.qd[tick - 1, joint])) if tick else 0.0
    peak = abs(float(acceleration[tick]))
    return peak, peak * run.dt / speed if speed else 0.0, speed


def _smooth(trials: pl.DataFrame, letter: str, limit: float, expected: str) -> Verdict:
    peaks = values_of(trials, "elbow_peak_qdd", algorithm=letter)
    within = peaks <= limit * (1.0 + _ROUNDING)
    measured = (
        f"largest of all trials {peaks.max():.2f} rad/s², limit {limit:g}; within it in {np.count_nonzero(within)} of "
        f"{len(peaks)} trials"
    )
    return Verdict(f"{letter}-smooth", letter, expected, measured, bool(within.all()))


def _freezes(trials: pl.DataFrame) -> Verdict:
    stops = values_of(trials, "stops", algorithm="B")
    standing = values_of(trials, "standing", algorithm="B")
    others = values_of(trials.filter(pl.col("algorithm") != "B"), "standing")
    measured = (
        f"{np.count_nonzero(stops > 0)} of {len(stops)} trials with a stop, {_middle(stops):g} in the median trial; "
        f"still for {_middle(standing):.2f} s in the median trial (A and C: {_middle(others):.2f} s)"
    )
    holds = _middle(stops) >= 1.0 and _middle(standing) > _middle(others)
    return Verdict(
        "B-freezes", "B", "B freezes at the limit: the arm stands still while the hand pulls", measured, holds
    )


def _all_joints(found: StudyResult) -> Verdict:
    trials = found.trials
    limits = np.array(found.settings.qdd_max)
    of_c = trials.filter(pl.col("algorithm") == "C")
    share = values_of(of_c, "peak_qdd") / limits[of_c["peak_qdd_joint"].to_numpy()]
    worst = int(np.argmax(share))
    measured = (
        f"largest of all trials {share.max():.3f} of the limit, of joint {of_c['peak_qdd_joint'][worst] + 1}; within "
        f"it in {np.count_nonzero(share <= 1.0 + _ROUNDING)} of {len(share)} trials"
    )
    return Verdict(
        "C-never-exceeds", "C", "C never exceeds the acceleration limit of any joint", measured,
        bool(np.all(share <= 1.0 + _ROUNDING)),
    )  # fmt: skip


def _gentler(trials: pl.DataFrame) -> Verdict:
    medians = {
        key: {letter: float(np.median(values)) for letter, values in operator_medians(trials, key).items()}
        for key in ("peak_qdd", "peak_torque", "peak_torque_rate")
    }
    measured = "medians over operators of A, B and C, peaks over joints: " + "; ".join(
        ", ".join(number(by[letter]) for letter in "ABC") + f" {unit}"
        for by, unit in zip(medians.values(), ("rad/s²", "Nm", "Nm/s"), strict=True)
    )
    holds = all(by["C"] < min(by["A"], by["B"]) for by in medians.values())
    return Verdict(
        "C-gentler", "C", "C stresses the hardware least: peaks of acceleration, torque and its rate", measured, holds
    )


def _same_time(tests: Sequence[OutcomeTest]) -> Verdict:
    found = {one.letters: one for one in tests if one.outcome.key == "time"}
    expected = "A and C take about as long, B longer (questions 2 and 3 of the questionnaire)"
    pairs = [found.get(pair) for pair in ("AC", "AB", "BC")]
    if any(one is None or one.holm is None for one in pairs):
        return Verdict("times", "B", expected, "the times could not be compared", None)
    medians = {letter: value for one in pairs if one for letter, value in one.medians.items()}
    p = {one.letters: one.holm for one in pairs if one and one.holm is not None}
    measured = (
        f"medians of A, B and C: {medians['A']:.2f}, {medians['B']:.2f}, {medians['C']:.2f} s; median tests, Holm's "
        f"correction: A and C p = {p['AC']:.2g}, A and B {p['AB']:.2g}, B and C {p['BC']:.2g}"
    )
    slower = medians["B"] > max(medians["A"], medians["C"])
    # Not by p: with enough operators the smallest difference would be one.
    alike = abs(medians["C"] / medians["A"] - 1.0) <= _ALIKE
    if slower and alike and max(p["AB"], p["BC"]) >= LEVEL:
        return Verdict("times", "B", expected, f"{measured}: too few operators to tell", None)
    return Verdict("times", "B", expected, measured, slower and alike)


def _expected_motion(trials: pl.DataFrame) -> Verdict:
    ticks = {letter: values_of(trials, "unexpected", algorithm=letter) for letter in "ABC"}
    of_c = ticks["C"]
    measured = (
        f"{int(of_c.sum())} ticks with v · v_actual < 0 in {len(of_c)} trials (A: {int(ticks['A'].sum())}, "
        f"B: {int(ticks['B'].sum())})"
    )
    expected = "the hand never works against an unexpected motion of C"
    return Verdict("C-expected", "C", expected, measured, bool(of_c.sum() == 0.0))


def _sound(trials: pl.DataFrame) -> Verdict:
    arrived = {
        letter: (int(np.sum(values_of(trials, "finished", algorithm=letter))), rows)
        for letter, rows in trials.group_by("algorithm").len().iter_rows()
    }
    unsolved = int(trials["unsolved"].sum())
    drift, angle = (float(values_of(trials, key).max()) for key in ("drift_mm", "drift_deg"))
    counted = ", ".join(f"{letter} {done} of {rows}" for letter, (done, rows) in sorted(arrived.items()))
    measured = (
        f"arrived: {counted}; {unsolved} ticks without an answer; largest drift of the locked rows "
        f"{drift:.2g} mm and {angle:.2g}°"
    )
    holds = unsolved == 0 and all(arrived[letter][0] == arrived[letter][1] for letter in "AC")
    return Verdict("sound", "all", "every trial with A or C arrives, and every tick has an answer", measured, holds)
