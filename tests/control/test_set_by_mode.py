"""`set` in one mode or in all: the interpreted and the compiled controller do the same."""

import numpy as np
import pytest

from kinqp.control import make_guiding, simulate_guiding
from kinqp.formulations import InputError, Mode
from kinqp.robots import load_robot
from kinqp.solvers import Status
from tests.control.hands import Pull

ROBOT = load_robot("lbr_med14")
START = np.deg2rad([-55.0, 65.0, 10.0, -90.0, -5.0, 30.0, 0.0])
MODES = ("fix-orientation", "free", "line:z")
SWING = Pull(lambda t, *_: np.array([8.0, 20.0, 12.0, 0.4, 0.3, 0.2]) * np.sin(4.0 * t + np.arange(6.0)))
SLOW, NARROW = np.full(6, 300.0), ROBOT.q_max.copy()
NARROW[3] = START[3] + 0.01
# Before the mode is engaged, while it is, after it, and in all of them; shapes of each mode's own.
SCHEDULE = [
    (0.1, lambda c: c.set("free", admittance_damping=SLOW, task_weight=[1.0, 1.0, 1.0, 0.02, 0.02, 0.03])),
    (0.2, lambda c: c.set("fix-orientation", task_weight=[1.0, 2.0, 3.0], joint_weight=1e-3, q_max=NARROW)),
    (0.3, lambda c: c.engage("free")),
    (0.5, lambda c: c.set(Mode.line("z"), admittance_damping=0.5 * SLOW, drift_gain=0.0, task_weight=4.0)),
    (0.6, lambda c: c.set("free", force_dead_zone=3.0, qdd_max=5.0)),
    (0.65, lambda c: c.set("free", admittance_damping=[60.0] * 3 + [6.0] * 3)),
    (0.7, lambda c: c.engage("line:z")),
    (1.0, lambda c: c.set(force_dead_zone=1.0, joint_weight=2e-4, qd_max=0.3)),
    (1.1, lambda c: c.set("fix-orientation", force_dead_zone=0.5)),
    (1.2, lambda c: c.engage("fix-orientation")),
]


def both(formulation="joint-space", modes=MODES):
    return [make_guiding(ROBOT, formulation, modes, compiled=compiled) for compiled in (False, True)]


def test_the_same_session() -> None:
    interpreted, compiled = (
        simulate_guiding(controller, SWING, START, 1.8, schedule=SCHEDULE) for controller in both()
    )
    assert compiled.q == pytest.approx(interpreted.q, abs=1e-9)
    assert compiled.qd == pytest.approx(interpreted.qd, abs=1e-8)
    for name in ("mode", "phase", "status"):
        assert getattr(compiled, name) == getattr(interpreted, name), name
    assert {str(mode) for mode in interpreted.mode} == set(MODES)


@pytest.mark.long
def test_every_one_of_these_settings_matters() -> None:
    """Otherwise the session above would prove nothing of it."""
    _, controller = both()
    full = simulate_guiding(controller, SWING, START, 1.8, schedule=SCHEDULE)
    for index, (time, _) in enumerate(SCHEDULE):
        _, controller = both()
        without = SCHEDULE[:index] + SCHEDULE[index + 1 :]
        run = simulate_guiding(controller, SWING, START, 1.8, schedule=without)
        assert np.abs(run.q - full.q).max() > 1e-7, time


@pytest.mark.parametrize(
    ("mode", "inputs", "error", "message"),
    [
        ("free", {"qd_max": 0.1}, InputError, r"^qd_max: expected for all modes at once, got mode free"),
        (
            "position",
            {"force_dead_zone": 0.1},
            ValueError,
            r"^mode: expected one of fix-orientation, free, line:z, got",
        ),
        ("line:z", {"task_weight": [1.0, 2.0]}, InputError, r"^task_weight: expected shape \(1,\)"),
        (None, {"task_weight": [1.0, 2.0, 3.0]}, InputError, r"^task_weight: expected shape \(6,\)"),
        ("free", {"q_min": 9.0}, InputError, r"^q_min and q_max: expected"),
        ("free", {"speed": 9.0}, InputError, r"^speed: expected an input among"),
    ],
)
def test_what_is_refused_changes_nothing(mode, inputs, error, message) -> None:
    for controller in both():
        for extra in ({}, {"force_dead_zone": 0.0}):
            with pytest.raises(error, match=message):
                controller.set(mode, **(inputs | extra))
        assert not controller(START, [0.9, 0, 0, 0, 0, 0]).v.any()


def test_both_name_the_same_inputs() -> None:
    interpreted, compiled = both()
    assert set(interpreted.inputs) == set(compiled.inputs)


def test_settings_outlast_a_reset() -> None:
    pull = [0.0, 20.0, 0.0, 0.0, 0.0, 0.0]
    answers = []
    for controller in both():
        controller.set("fix-orientation", admittance_damping=SLOW)
        before = controller(START, pull).v
        controller.engage("free")
        for _ in range(3):
            controller(START, np.zeros(6))
        controller.reset()
        assert controller(START, pull).v == pytest.approx(before, abs=1e-15)
        answers.append(before)
    assert answers[1] == pytest.approx(answers[0], abs=1e-12)


@pytest.mark.long
def test_what_has_no_default_must_be_set_in_the_mode_that_is_engaged() -> None:
    modes = ("position", "free")
    pivot = ROBOT.pose(START)[:3, 3] - 0.1 * ROBOT.pose(START)[:3, 2]
    for controller in both("joint-space + remote-centre", modes):
        controller.set("free", remote_centre_pivot=pivot)
        for _ in range(2):
            with pytest.raises(InputError, match=r"^remote_centre_pivot: expected shape \(3,\) \[m\], got nothing"):
                controller(START, np.zeros(6))
        controller.set("position", remote_centre_pivot=pivot)
        assert controller(START, [0, 20.0, 0, 0, 0, 0]).status is Status.SOLVED
