"""The hand-guiding controller: modes, agreement with the hand, mistakes, and every formulation and baseline in it."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinqp.control import GuidingSettings, simulate_guiding
from kinqp.formulations import InputError
from kinqp.solvers import PluginError, Status
from tests.control.guided import DT, ROBOT, START, controller_with, guiding, quick
from tests.control.hands import constant, smooth


@functools.cache
def through_three_modes():
    """A run through three modes, a second each, in which the hand never lets go."""
    return simulate_guiding(
        guiding(["fix-orientation", "line:z", "fix-position"]),
        smooth(0.0, 13.0, 5.0, 1.0, 0.0, 0.5),
        START,
        3.0,
        schedule=[(1.0, lambda c: c.engage("line:z")), (2.0, lambda c: c.engage("fix-position"))],
    )


class TestModes:
    def test_engaged_and_left_without_a_jump(self):
        run = through_three_modes()
        modes = list(dict.fromkeys(str(mode) for mode in run.mode))
        assert modes == ["fix-orientation", "line:z", "fix-position"]
        # The hand never lets go. What it pulls on a mass at rest is the largest change of velocity there is:
        # 3.4 m/s^2 and 14 rad/s^2; a jump of 0.2 m/s in a tick would be 200 m/s^2.
        change = np.diff(run.twist, axis=0) / DT
        assert np.abs(change[:, :3]).max() < 4.0
        assert np.abs(change[:, 3:]).max() < 15.0
        # The switch itself happens at rest.
        for tick in np.flatnonzero([a is not b for a, b in zip(run.mode[1:], run.mode[:-1], strict=True)]):
            assert not run.qd[tick].any()
        assert set(run.status) == {Status.SOLVED}

    def test_locked_rows_do_not_move_in_any_mode(self):
        run = through_three_modes()
        for tick in range(0, len(run.t), 50):
            locked = list(run.mode[tick].fixed_rows)
            # Drift compensation alone moves them, by less than 0.1 mm/s here.
            assert np.abs(run.v_actual[tick, locked]).max() < 1e-4

    def test_the_same_mode_again_is_anchored_anew(self):
        controller = guiding(["position", "fix-orientation"])
        run = simulate_guiding(controller, smooth(0, 10.0, 0, 0, 0, 0), START, 1.0)
        assert run.drift.max() == 0.0  # nothing is locked
        controller.engage("fix-orientation")
        q = run.q_end
        for _ in range(400):
            q = q + DT * controller(q, np.zeros(6)).qd
        assert str(controller.mode) == "fix-orientation"
        assert controller(q, np.zeros(6)).drift == pytest.approx([0.0, 0.0], abs=1e-9)

    def test_no_such_mode(self):
        with pytest.raises(ValueError, match="mode: expected one of fix-orientation, got 'line:z'"):
            guiding().engage("line:z")

    def test_a_formulation_that_brakes_comes_to_rest_too(self):
        controller = guiding(["fix-orientation", "line:z"], "joint-space-robust")
        run = simulate_guiding(
            controller, smooth(0, 10, 0, 0, 0, 0), START, 1.6, schedule=[(0.8, lambda c: c.engage("line:z"))]
        )
        assert str(run.mode[-1]) == "line:z"
        assert np.abs(run.acceleration()).max() < 10.0 * (1 + 1e-6)


class TestTheHandNeverWorksAgainstAnUnexpectedMotion:
    @quick
    @given(st.lists(st.floats(-60.0, 60.0), min_size=3, max_size=3), st.integers(0, 2**32 - 1))
    def test_commanded_and_actual_velocity_agree_in_direction(self, force, seed):
        controller = controller_with(GuidingSettings())
        rng = np.random.default_rng(seed)
        q = ROBOT.q_min + rng.random(7) * (ROBOT.q_max - ROBOT.q_min)
        at_limit = rng.random(7) < 0.3
        q = np.where(at_limit, np.where(rng.random(7) < 0.5, ROBOT.q_min, ROBOT.q_max), q)
        result = controller(q, [*force, 0, 0, 0])
        assert result.v @ result.v_actual >= -1e-12


class TestBadInput:
    @pytest.mark.parametrize(
        ("q", "wrench", "message"),
        [
            (START[:6], np.zeros(6), r"q: expected shape \(7,\), got \(6,\)"),
            (START, np.zeros(3), r"wrench: expected shape \(6,\), got \(3,\)"),
            (START, "pull", "wrench: expected real numbers, got entries of type <U4"),
        ],
    )
    def test_call(self, q, wrench, message):
        with pytest.raises(InputError, match=message):
            guiding()(q, wrench)

    @pytest.mark.parametrize(
        ("inputs", "message"),
        [
            ({"speed": 1.0}, "speed: expected an input among"),
            ({"qd_max": -1.0}, "qd_max: expected numbers above 0"),
            ({"admittance_mass": [1.0, 2.0]}, r"admittance_mass: expected shape \(6,\)"),
            ({"q_min": 9.0}, "q_min and q_max: expected q_min <= q_max"),
            ({"task_weight": [1.0, 2.0]}, r"task_weight: expected shape \(3,\)"),
        ],
    )
    def test_set_changes_nothing(self, inputs, message):
        controller = guiding()
        with pytest.raises(InputError, match=message):
            controller.set(force_dead_zone=0.0, **inputs)
        assert not controller(START, [0.9, 0, 0, 0, 0, 0]).v.any()

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"admittance_mass": [1, 2]}, "admittance_mass: expected 6 positive numbers"),
            ({"admittance_damping": [0] * 6}, "admittance_damping: expected 6 positive numbers"),
            ({"drift_gain": -1}, "drift_gain: expected a number that is not negative"),
            ({"stop_deceleration": 0}, "stop_deceleration: expected a positive number"),
            ({"max_failures": 0}, "max_failures: expected a count of at least 1"),
        ],
    )
    def test_settings(self, settings, message):
        with pytest.raises(ValueError, match=message):
            GuidingSettings(**settings)

    def test_making(self):
        with pytest.raises(PluginError, match="baseline task-priority: expected compiled=False"):
            guiding(formulation="task-priority", compiled=True)
        with pytest.raises(ValueError, match="modes: expected at least one, each once, got free, free"):
            guiding(["free", "free"])
        with pytest.raises(ValueError, match="dt: expected 1e-05 to 1 s"):
            guiding(dt=0.0)
        with pytest.raises(ValueError, match="duration: expected at least two periods"):
            simulate_guiding(guiding(), constant(0, 0, 0, 0, 0, 0), START, 1e-3)


def test_compiled_and_interpreted_agree():
    hand = smooth(4.0, 13.0, -6.0, 0.5, 0.2, -0.3)
    runs = [
        simulate_guiding(
            guiding(["fix-orientation", "fix-position"], compiled=compiled),
            hand,
            START,
            1.5,
            schedule=[(0.8, lambda c: c.engage("fix-position"))],
        )
        for compiled in (False, True)
    ]
    assert runs[0].q == pytest.approx(runs[1].q, abs=1e-10)
    assert runs[0].mode == runs[1].mode


@pytest.mark.parametrize("formulation", ["task-priority", "saturation-null-space", "hierarchical", "damped"])
def test_any_controller_can_be_guided(formulation):
    run = simulate_guiding(guiding(formulation=formulation), smooth(0, 13.0, 0, 0, 0, 0), START, 1.0)
    assert run.twist[-1, 1] == pytest.approx(0.2, rel=0.05)
    assert run.power().min() >= -1e-9
