"""The observer of joint positions, alone and in the guiding controllers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinqp.control import GuidingSettings, PositionObserver, make_guiding
from kinqp.formulations import InputError
from kinqp.robots import load_robot

ROBOT = load_robot("lbr_med14")
START = np.deg2rad([-55.0, 65.0, 10.0, -90.0, -5.0, 30.0, 0.0])
MODES = ("fix-orientation", "line:z")
DT = 1e-3
NOISE = 1e-5


def test_with_gain_one_it_is_the_measurement_to_the_last_bit():
    rng = np.random.default_rng(0)
    observe = PositionObserver(7, gain=1.0)
    for _ in range(50):
        measured = rng.normal(size=7)
        assert observe(measured, rng.normal(size=7)).tobytes() == measured.tobytes()


def test_an_arm_that_follows_is_seen_where_it_is():
    rng = np.random.default_rng(1)
    observe = PositionObserver(7, gain=0.05)
    q, qd = START, np.zeros(7)
    for _ in range(500):
        np.testing.assert_allclose(observe(q, qd), q, rtol=0, atol=1e-13)
        qd = 0.5 * rng.normal(size=7)
        q = q + DT * qd


@settings(deadline=None, max_examples=20, derandomize=True)
@given(st.floats(0.01, 1.0))
def test_what_it_leaves_of_noise(gain):
    """Its variance is gain / (2 - gain) of the encoder's, that of its change gain^2 * 2 / (2 - gain)."""
    rng = np.random.default_rng(2)
    observe = PositionObserver(40, gain=gain)
    noise = NOISE * rng.normal(size=(4000, 40))
    seen = np.array([observe(row, np.zeros(40)) for row in noise])[round(8 / gain) :]
    assert np.var(seen) == pytest.approx(gain / (2 - gain) * NOISE**2, rel=0.15)
    change = np.diff(seen, axis=0)
    assert np.var(change) == pytest.approx(2 * gain**2 / (2 - gain) * NOISE**2, rel=0.05)


def test_behind_an_arm_that_follows_with_a_lag():
    """While it accelerates: lag * |qdd| dt / gain, as the docstring says."""
    lag, gain, qdd = 0.01, 0.05, 2.0
    observe = PositionObserver(1, gain=gain)
    follow = 1.0 - np.exp(-DT / lag)
    q, moved, qd = np.zeros(1), np.zeros(1), np.zeros(1)
    off = []
    for _ in range(1000):
        off.append(float(observe(q, qd)[0] - q[0]))
        qd = qd + DT * qdd
        moved = moved + follow * (qd - moved)
        q = q + DT * moved
    assert off[-1] == pytest.approx(lag * qdd * DT / gain, rel=0.1)
    assert max(off) <= lag * qdd * DT / gain


def test_a_jump_is_believed_at_once_and_one_joint_at_a_time():
    observe = PositionObserver(2, gain=0.1)
    observe([0.0, 0.0], [0.0, 0.0])
    np.testing.assert_allclose(observe([0.3, 0.01], [0.0, 0.0]), [0.3, 0.001], rtol=0, atol=1e-15)
    observe.reset()
    np.testing.assert_allclose(observe([0.02, 0.02], [100.0, 100.0]), [0.02, 0.02], rtol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"nv": 0}, "nv: expected a number of joints, got 0"),
        ({"gain": 0.0}, "gain: expected a number above 0 and at most 1, got 0.0"),
        ({"gain": float("nan")}, "gain: expected a number above 0 and at most 1, got nan"),
        ({"gain": 1.5}, "gain: expected a number above 0 and at most 1, got 1.5"),
        ({"jump": -1.0}, "jump: expected a positive number, got -1.0"),
        ({"dt": 0.0}, "dt: expected 1e-05 to 1 s, got 0.0"),
    ],
)
def test_bad_parameters(arguments, message):
    with pytest.raises(ValueError, match=message):
        PositionObserver(**({"nv": 7} | arguments))


def test_bad_measurements_change_nothing():
    observe = PositionObserver(2, gain=0.5)
    observe([1.0, 1.0], [0.0, 0.0])
    with pytest.raises(InputError, match="measured: expected finite numbers"):
        observe([np.nan, 1.0], [0.0, 0.0])
    with pytest.raises(InputError, match=r"qd_prev: expected shape \(2,\), got \(3,\)"):
        observe([1.0, 1.0], np.zeros(3))
    np.testing.assert_array_equal(observe([1.02, 1.0], [0.0, 0.0]), [1.01, 1.0])


def noisy_session(controller):
    """Commands and states of a hand that pulls to and fro on an arm whose encoders are noisy, a mode engaged midway."""
    rng = np.random.default_rng(3)
    q, states, commands = START, [], []
    controller.reset()
    for tick in range(600):
        if tick == 300:
            controller.engage("line:z")
        wrench = np.array([8.0, 20.0, 12.0, 0.4, 0.3, 0.2]) * np.sin(6.0 * tick * DT + np.arange(6.0))
        qd = controller(q + NOISE * rng.normal(size=7), wrench).qd
        states.append(q)
        commands.append(qd)
        q = q + DT * qd
    return np.array(states), np.array(commands)


@pytest.mark.parametrize("gain", [1.0, 0.05])
def test_compiled_and_interpreted_controllers_agree_on_noisy_positions(gain):
    runs = []
    for compiled in (False, True):
        chosen = GuidingSettings(observer_gain=gain)
        runs.append(noisy_session(make_guiding(ROBOT, "joint-space", MODES, settings=chosen, compiled=compiled)))
    for one, other in zip(*runs, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)


def test_with_it_locked_rows_hold_better_where_the_arm_really_is():
    """Against the same controller on positions as measured; without drift correction, which moves these rows."""
    controller = make_guiding(ROBOT, "joint-space", MODES, compiled=True)
    errors = {}
    for gain in (1.0, 0.05):
        controller.set(observer_gain=gain, drift_gain=0.0)
        states, commands = noisy_session(controller)
        rows = [ROBOT.jacobian(q)[3:] @ qd for q, qd in zip(states[:290], commands[:290], strict=True)]
        errors[gain] = float(np.sqrt(np.mean(np.square(rows))))
    assert errors[0.05] < 0.5 * errors[1.0]


def test_with_it_the_drift_correction_does_not_follow_the_noise():
    controller = make_guiding(ROBOT, "joint-space", MODES, compiled=True)
    jumps = {}
    for gain in (1.0, 0.05):
        controller.set(observer_gain=gain)
        _, commands = noisy_session(controller)
        jumps[gain] = float(np.sqrt(np.mean(np.diff(commands[:290], n=2, axis=0) ** 2)))
    assert jumps[0.05] < 0.5 * jumps[1.0]


def test_settings_are_checked():
    with pytest.raises(ValueError, match=r"observer_gain: expected a positive number, got 0\.0"):
        GuidingSettings(observer_gain=0.0)
    controller = make_guiding(ROBOT, "joint-space", MODES)
    with pytest.raises(InputError, match="observer_jump: expected numbers above 0 rad or m"):
        controller.set(observer_jump=0.0)


def test_after_samples_lost_for_longer_the_next_measurement_is_taken_as_it_is():
    settings = GuidingSettings(observer_gain=0.01, hold_ticks=0)
    controller = make_guiding(ROBOT, "joint-space", MODES, compiled=True, settings=settings)
    controller(START, np.zeros(6))
    controller._q[0] = np.nan  # past the checks of the Python side: what a robot's own program may hand over
    controller._tick(controller._parameters, controller._state, controller._input, controller._output)
    moved = START + 0.04
    controller(moved, np.zeros(6))
    np.testing.assert_allclose(list(controller._state.q_observed), moved, rtol=1e-15)
