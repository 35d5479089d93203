"""Weighted least norm, progressive clamping, augmentation, compensation: by hand, and what each is known for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinqp.baselines import NullSpaceCompensation, ProgressiveClamping, TaskAugmentation, WeightedLeastNorm
from kinqp.control import make_step, simulate
from kinqp.formulations import Mode
from tests.baselines.planar import situation
from tests.robots.arms import arm

Array = np.ndarray
ROW = np.ones((1, 3))


def weighted(q: Array, slope: list[float], last: list[float], v: float = 3.0) -> Array:
    at = situation(ROW, [v], q=q, qd_prev=last, extras={"slope": np.array(slope)[:, None]})
    return WeightedLeastNorm().resolve(at).qd


def test_weights_by_hand() -> None:
    """w = (4, 1, 1) for motion towards the limit: shares 1/4 : 1 : 1 of 3."""
    q = np.zeros(3)
    np.testing.assert_allclose(weighted(q, [3.0, 0.0, 0.0], [0.1, 0.1, 0.1]), np.array([1.0, 4.0, 4.0]) / 3.0)
    np.testing.assert_allclose(weighted(q, [3.0, 0.0, 0.0], [-0.1, 0.1, 0.1]), [1.0, 1.0, 1.0])
    # Towards the lower limit the slope is negative.
    np.testing.assert_allclose(weighted(q, [-3.0, 0.0, 0.0], [-0.1, 0.1, 0.1]), np.array([1.0, 4.0, 4.0]) / 3.0)


def test_weights_of_joints_at_rest_are_judged_by_where_they_would_go() -> None:
    q = np.array([1.0, 0.0, 0.0])  # on the upper limit
    np.testing.assert_allclose(weighted(q, [9.0, 0.0, 0.0], [0.0, 0.0, 0.0], 3.0), [0.0, 1.5, 1.5])
    np.testing.assert_allclose(weighted(q, [9.0, 0.0, 0.0], [0.0, 0.0, 0.0], -3.0), [-1.0, -1.0, -1.0])


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_it_is_equation_3_5(seed: int) -> None:
    """All rows in one J, W^-1 J' (J W^-1 J')^-1 xd written out."""
    rng = np.random.default_rng(seed)
    J_fixed, J_free = rng.normal(size=(2, 7)), rng.normal(size=(3, 7))
    v, v_fixed, slope, last = rng.normal(size=3), rng.normal(size=2), 5.0 * rng.normal(size=7), rng.normal(size=7)
    at = situation(J_free, v, J_fixed=J_fixed, v_fixed=v_fixed, qd_prev=last, extras={"slope": slope[:, None]})
    w = np.where(last * slope >= 0.0, 1.0 + np.abs(slope), 1.0)
    J, inverse = np.vstack((J_fixed, J_free)), np.diag(1.0 / w)
    expected = inverse @ J.T @ np.linalg.solve(J @ inverse @ J.T, np.append(v_fixed, v))
    np.testing.assert_allclose(WeightedLeastNorm().resolve(at).qd, expected, atol=1e-9 * (1 + np.abs(expected).max()))


class Pull:
    """A hand that pulls one way."""

    def __init__(self, linear: list[float]) -> None:
        self.linear = linear

    def twist(self, t: float, pose: Array) -> Array:  # noqa: ARG002  # as a Guide is called
        return np.array([*self.linear, 0.0, 0.0, 0.0])


def chan_dubey_slope(q: Array, low: Array, high: Array) -> Array:
    """dH/dq of H = sum (high - low)^2 / (4 (high - q)(q - low)), as Chan and Dubey print it."""
    return (high - low) ** 2 * (2.0 * q - high - low) / (4.0 * (high - q) ** 2 * (q - low) ** 2)


def test_a_weighted_joint_approaches_its_limit_with_zero_velocity_where_others_can_do_the_task() -> None:
    """Row (1, 1, 1), limits of +-1 rad for joint 0, far away for the others; a hand that pulls for half a minute."""
    low, high = np.array([-1.0, -100.0, -100.0]), np.array([1.0, 100.0, 100.0])
    q, last, path = np.zeros(3), np.zeros(3), []
    for _ in range(3000):
        slope = chan_dubey_slope(q, low, high)[:, None]
        at = situation(ROW, [1.5], q=q, dt=0.01, qd_prev=last, q_min=low, q_max=high, extras={"slope": slope})
        last = WeightedLeastNorm().resolve(at).qd
        q = q + 0.01 * last
        path.append((1.0 - q[0], last[0]))
    distance, speed = np.array(path).T
    assert distance.min() > 0.0
    assert distance[-1] < 0.05
    assert (np.diff(speed) < 1e-12).all(), "the closer, the slower"
    assert speed[-1] < 0.005 * speed[0]
    # Close to the limit w grows with 1 / d^2, so that the speed fades with the square of the distance.
    exponent = np.polyfit(np.log(distance[-1000:]), np.log(speed[-1000:]), 1)[0]
    assert exponent == pytest.approx(2.0, abs=0.15)
    assert q.sum() == pytest.approx(45.0, abs=1e-9), "the task is done all the same"


def test_the_slope_is_chan_and_dubeys() -> None:
    """Through the step: the weights are those of the printed formula."""
    robot = arm("lbr_med14")
    q = np.deg2rad([100.0, -60.0, 20.0, -80.0, 90.0, 60.0, -120.0])
    at = make_step(robot, "weighted-least-norm", "position").observe(q, np.zeros(3), qd_prev=np.zeros(7))
    expected = chan_dubey_slope(q, robot.q_min, robot.q_max)
    np.testing.assert_allclose(at.extras["slope"][:, 0], expected, rtol=1e-12)


def test_clamping_by_hand() -> None:
    """Range 2, zone 0.05 of it: 0.1 wide. Half way in, d = 1/2 and h = 1/2; moving out, no damping."""
    at = situation(np.eye(3), [0.4, 0.4, 0.4], q=np.array([0.95, -0.95, 0.0]), zone=0.05)
    found = ProgressiveClamping().resolve(at)
    np.testing.assert_allclose(found.qd, [0.2, 0.4, 0.4], atol=1e-14)
    assert found.active == ("joint limits[0] upper",)
    # d = 0.8: h = 3 0.64 - 2 0.512 = 0.896
    at = situation(np.eye(3), [-0.5, 0.5, 0.0], q=np.array([-0.98, 0.98, 1.0]), zone=0.05)
    np.testing.assert_allclose(ProgressiveClamping().resolve(at).qd, [-0.052, 0.052, 0.0], atol=1e-14)
    # 0.1 mrad ahead of the limit, 0.4 mrad in a period: stopped.
    at = situation(np.eye(3), [0.4, -0.4, 0.4], q=np.array([0.9999, -1.5, 1.5]), zone=0.05)
    np.testing.assert_array_equal(ProgressiveClamping().resolve(at).qd, [0.0, 0.0, 0.0])


def test_clamping_loses_the_locked_rows_and_says_so() -> None:
    robot = arm("lbr_med14")
    q = np.deg2rad([10.0, 30.0, 5.0, -118.0, -5.0, 60.0, 0.0])
    pull = -0.1 * robot.jacobian(q)[:3, 3]
    result = make_step(robot, "progressive-clamping", "fix-orientation")(q, pull)
    assert result.fixed_error > 1e-3
    assert "a locked row is off" in result.message


def test_augmentation_by_hand() -> None:
    """Row sum = 3 with a bound of 0.5 on joint 0: a second row, both hold. With three such rows they contradict."""
    found = TaskAugmentation().resolve(situation(ROW, [3.0], bound=[0.5, 9.0, 9.0], limit_weight=1.0))
    np.testing.assert_allclose(found.qd, [0.5, 1.25, 1.25], atol=1e-14)
    assert found.active == ("joint limits[0] upper",)
    # min (sum - 3)^2 + sum (qd_i - 1/2)^2: each 7/8; a weight of 3 on the limits: each 1/2 + 1.5/6 = 3/4.
    for weight, expected in ((1.0, 7.0 / 8.0), (3.0, 3.0 / 4.0)):
        found = TaskAugmentation().resolve(situation(ROW, [3.0], bound=0.5, limit_weight=weight))
        np.testing.assert_allclose(found.qd, expected, atol=1e-14)


def test_compensation_by_hand() -> None:
    """The overdriven joint at its bound, the task unchanged; the second pass adds the next; then all slow down."""
    one = NullSpaceCompensation().resolve(situation(ROW, [3.0], bound=[0.5, 2.0, 2.0]))
    np.testing.assert_allclose(one.qd, [0.5, 1.25, 1.25], atol=1e-14)
    assert one.iterations == 2
    two = NullSpaceCompensation().resolve(situation(ROW, [3.0], bound=[0.5, 1.2, 2.0]))
    np.testing.assert_allclose(two.qd, [0.5, 1.2, 1.3], atol=1e-14)
    assert two.iterations == 3
    # Both over at once, S N has rank 1: (3/2, 3/2) times 1/3 is where joint 0 is at its bound.
    both = NullSpaceCompensation().resolve(situation(np.ones((1, 2)), [3.0], bound=[0.5, 1.0]))
    np.testing.assert_allclose(both.qd, [0.5, 0.5], atol=1e-14)
    assert both.active == ("joint limits[0] upper",)
    # One after the other: (1/2, 5/2), then the same rank; times 4/5 is where joint 1 is at its bound.
    later = NullSpaceCompensation().resolve(situation(np.ones((1, 2)), [3.0], bound=[0.5, 2.0]))
    np.testing.assert_allclose(later.qd, [0.4, 2.0], atol=1e-14)
    assert later.active == ("joint limits[1] upper",)
    assert later.iterations == 2


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_compensation_keeps_bounds_direction_and_locked_rows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    J_fixed, J, v = rng.normal(size=(2, 7)), rng.normal(size=(2, 7)), rng.normal(size=2) * rng.choice([0.1, 1.0, 9.0])
    upper, lower = rng.uniform(0, 1, 7) * (rng.random(7) < 0.8), -rng.uniform(0, 1, 7) * (rng.random(7) < 0.8)
    qd = NullSpaceCompensation().resolve(situation(J, v, J_fixed=J_fixed, bound=upper, lower=lower)).qd
    assert (qd <= upper + 1e-9).all()
    assert (qd >= lower - 1e-9).all()
    np.testing.assert_allclose(J_fixed @ qd, 0.0, atol=1e-9)
    scale = float(v @ (J @ qd) / (v @ v))
    assert -1e-12 <= scale <= 1.0 + 1e-12
    np.testing.assert_allclose(J @ qd, scale * v, atol=1e-9)


def test_closed_loop_of_the_weighted_norm_hands_on_the_last_command() -> None:
    robot = arm("lbr_med14")
    step = make_step(robot, "weighted-least-norm", Mode.position())
    assert "qd_prev" in step.inputs
    q = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
    run = simulate(step, Pull([0.1, 0.0, 0.0]), q, 0.05)
    by_hand = step(run.q[10], [0.1, 0.0, 0.0], qd_prev=run.qd[9])
    np.testing.assert_array_equal(run.qd[10], by_hand.qd)
    with pytest.raises(AssertionError):
        np.testing.assert_array_equal(run.qd[10], step(run.q[10], [0.1, 0.0, 0.0], qd_prev=-run.qd[9]).qd)
