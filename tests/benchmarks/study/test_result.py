import dataclasses
import json

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks.study import ALGORITHMS, StudyError, StudyResult, StudySettings
from kinqp.benchmarks.study.result import TRIAL_COLUMNS
from kinqp.control import GuidedRun, GuidingPhase
from kinqp.formulations import Mode
from kinqp.robots import load_robot
from kinqp.solvers import Status

ROBOT = load_robot("lbr_med14")
COUNT = 5


def settings() -> StudySettings:
    limits = {n: tuple(getattr(ROBOT, n).tolist()) for n in ("q_min", "q_max", "qd_max", "qdd_max", "tau_max")}
    return StudySettings(
        robot="lbr_med14", mode="fix-orientation", algorithms=dict(ALGORITHMS), dt=1e-3, q0=(0.1,) * 7, radius=0.3,
        elbow=3, seed=7, operators=2, trials=1, characters={"expert": {"stiffness": 300.0}}, counts={"expert": 2},
        time_limit=20.0, representative=(1, 0), **limits,
    )  # fmt: skip


def run(seed: int) -> GuidedRun:
    rng = np.random.default_rng(seed)
    return GuidedRun(
        t=np.arange(COUNT) * 1e-3, q=rng.normal(size=(COUNT, 7)), qd=rng.normal(size=(COUNT, 7)),
        position=rng.normal(size=(COUNT, 3)), rotation=rng.normal(size=(COUNT, 3, 3)),
        wrench=rng.normal(size=(COUNT, 6)),
        twist=rng.normal(size=(COUNT, 6)), v=rng.normal(size=(COUNT, 6)), v_actual=rng.normal(size=(COUNT, 6)),
        status=(Status.SOLVED,) * 4 + (Status.INACCURATE,), mode=(Mode.fix_orientation(),) * COUNT,
        phase=(GuidingPhase.GUIDING,) * 4 + (GuidingPhase.STOPPED,),
        active=((), ("joint limits[3] lower",), (), ("a", "b"), ()),
        iterations=np.arange(COUNT), drift=rng.normal(size=(COUNT, 2)), yielded=np.arange(COUNT) % 2 == 0, dt=1e-3,
        robot=ROBOT, q_end=rng.normal(size=7),
    )  # fmt: skip


def trials() -> pl.DataFrame:
    row = {name: kind.to_python()(1) for name, kind in TRIAL_COLUMNS.items()}
    return pl.DataFrame([row, row], schema=TRIAL_COLUMNS)


def result() -> StudyResult:
    runs = {letter: run(number) for number, letter in enumerate(ALGORITHMS)}
    return StudyResult(trials(), runs, {letter: 3.0 * each.q for letter, each in runs.items()}, settings())


def test_what_is_written_is_what_is_read(tmp_path):
    written = result()
    written.write(tmp_path / "new" / "study")
    read = StudyResult.read(tmp_path / "new" / "study")
    assert read.settings == written.settings
    assert read.trials.equals(written.trials)
    assert list(read.runs) == list(ALGORITHMS)
    for letter, expected in written.runs.items():
        for field in dataclasses.fields(GuidedRun):
            got, wanted = getattr(read.runs[letter], field.name), getattr(expected, field.name)
            if field.name == "robot":
                assert got.name == wanted.name
            elif isinstance(wanted, np.ndarray):
                np.testing.assert_array_equal(got, wanted)
            else:
                assert got == wanted
        np.testing.assert_array_equal(read.torques[letter], written.torques[letter])


def test_a_folder_without_settings_is_no_study(tmp_path):
    result().write(tmp_path)
    (tmp_path / "settings.json").unlink()
    with pytest.raises(StudyError, match=r"settings\.json"):
        StudyResult.read(tmp_path)


def test_another_format_is_refused(tmp_path):
    result().write(tmp_path)
    path = tmp_path / "settings.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format": 99}))
    with pytest.raises(StudyError, match="format 1, got 99"):
        StudyResult.read(tmp_path)


def test_unknown_settings_are_refused():
    content = json.loads(json.dumps(dataclasses.asdict(settings())))
    assert StudySettings.from_json(content) == settings()
    with pytest.raises(StudyError, match="colour"):
        StudySettings.from_json(content | {"colour": 1})
