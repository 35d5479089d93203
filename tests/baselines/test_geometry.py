"""Geometric clamping and scaling: by hand in the plane, the equations, and where the QP does better."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinqp.baselines import GeometricClamping, GeometricScaling
from kinqp.control import make_step
from kinqp.formulations import Mode
from kinqp.solvers import Status
from tests.baselines.planar import situation
from tests.formulations.reference import adversarial_state, bounds_at
from tests.robots.arms import arm

Array = np.ndarray
# Two joints, two rows: joint 0's critical direction is (1, 1), joint 1's (0, 1).
SLANTED = np.linalg.inv(np.array([[1.0, 1.0], [0.0, 1.0]]))


def test_one_joint_by_hand() -> None:
    """v = (3, 1): joint 0 would go at 4, its bound is 1. Parallel part (2, 2), perpendicular (1, -1)."""
    at = situation(SLANTED, [3.0, 1.0], bound=[1.0, 9.0])
    clamped = GeometricClamping().resolve(at)
    np.testing.assert_allclose(SLANTED @ clamped.qd, [1.0, -1.0], atol=1e-14)
    np.testing.assert_allclose(clamped.qd, [0.0, -1.0], atol=1e-14)
    scaled = GeometricScaling().resolve(at)
    # alpha = limit over demand = 1/4, not the printed 4.
    np.testing.assert_allclose(SLANTED @ scaled.qd, 0.25 * np.array([2.0, 2.0]) + np.array([1.0, -1.0]), atol=1e-14)
    np.testing.assert_allclose(scaled.qd, [1.0, -0.5], atol=1e-14)
    assert clamped.active == scaled.active == ("joint limits[0] upper",)


def test_two_joints_meet_in_a_point() -> None:
    """Both over: the planes x + y = 1 and y = 1/2 meet in (1/2, 1/2)."""
    scaled = GeometricScaling().resolve(situation(SLANTED, [3.0, 1.0], bound=[1.0, 0.5], lower=[-1.0, -0.4]))
    # Joint 0 first leads joint 1 to -1/2, below -0.4: the planes meet in x = 1.4, y = -0.4.
    np.testing.assert_allclose(SLANTED @ scaled.qd, [1.4, -0.4], atol=1e-14)
    assert scaled.active == ("joint limits[0] upper", "joint limits[1] lower")
    clamped = GeometricClamping().resolve(situation(SLANTED, [3.0, 1.0], bound=[1.0, 0.5], lower=[-1.0, -0.4]))
    np.testing.assert_allclose(clamped.qd, [0.0, 0.0], atol=1e-14)


def test_parallel_planes_by_hand() -> None:
    """Joint 0 goes at 10 x, joint 1 at x: bounds 20 and 1 are the planes x = 2 and x = 1, the second more critical."""
    J = np.linalg.pinv(np.array([[10.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    at = situation(J, [4.0, 3.0], bound=[20.0, 1.0, 9.0])
    inverse = np.linalg.pinv(J)
    np.testing.assert_allclose(inverse, [[10.0, 0.0], [1.0, 0.0], [0.0, 1.0]], atol=1e-14)
    scaled = GeometricScaling().resolve(at)
    np.testing.assert_allclose(scaled.qd, [10.0, 1.0, 3.0], atol=1e-13)
    assert scaled.active == ("joint limits[1] upper",)


def test_planes_that_do_not_meet_leave_the_common_factor() -> None:
    """Three planes in two dimensions: the whole task by the smallest alpha, within all bounds, direction kept."""
    rng, seen = np.random.default_rng(0), 0
    for _ in range(300):
        inverse, v, bound = rng.normal(size=(3, 2)), 3.0 * rng.normal(size=2), rng.uniform(0.05, 1.0, 3)
        found = GeometricScaling().resolve(situation(np.linalg.pinv(inverse), v, bound=bound))
        demand = inverse @ v
        assert (np.abs(found.qd) <= bound + 1e-12).all()
        if found.iterations == 3 and len(found.active) == 1:
            seen += 1
            alpha = np.min(bound / np.abs(demand))
            np.testing.assert_allclose(found.qd, alpha * demand, atol=1e-12)
    assert seen >= 5


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_equations_4_15_to_4_25_with_one_joint_over(seed: int) -> None:
    rng = np.random.default_rng(seed)
    J_fixed, J, v = rng.normal(size=(3, 7)), rng.normal(size=(3, 7)), rng.normal(size=3)
    N_c = np.eye(7) - np.linalg.pinv(J_fixed) @ J_fixed
    inverse = np.linalg.pinv(J @ N_c, rcond=1e-10)
    demand = inverse @ v
    i = int(rng.integers(7))
    bound = np.full(7, 100.0 * np.abs(demand).max())
    bound[i] = rng.uniform(0.05, 0.95) * abs(demand[i])
    direction = inverse[i] / np.linalg.norm(inverse[i])
    parallel = direction * (direction @ v)
    at = situation(J, v, J_fixed=J_fixed, bound=bound)
    size = 1e-9 * (1.0 + np.abs(demand).max())
    np.testing.assert_allclose(J @ GeometricClamping().resolve(at).qd, v - parallel, atol=size)
    alpha = bound[i] / abs(demand[i])
    found = GeometricScaling().resolve(at).qd
    np.testing.assert_allclose(J @ found, alpha * parallel + v - parallel, atol=size)
    assert abs(found[i]) == pytest.approx(bound[i], rel=1e-9)
    np.testing.assert_allclose(J_fixed @ found, 0.0, atol=size)


@pytest.mark.parametrize("text", ["fix-orientation", "fix-position", "position"])
def test_the_qp_is_never_worse(text: str) -> None:
    """`cartesian-error` minimises what geometric scaling only makes feasible; with one joint over they are the same."""
    robot, mode = arm("lbr_med14"), Mode.parse(text)
    scaling, qp = make_step(robot, "geometric-scaling", mode), make_step(robot, "cartesian-error", mode)
    rng, same, better = np.random.default_rng(4), 0, 0
    for _ in range(150):
        q, v = adversarial_state(robot, rng), 0.3 * rng.normal(size=mode.m_free)
        geometric, best = scaling(q, v), qp(q, v)
        assert geometric.status is best.status is Status.SOLVED
        if geometric.sigma_min < 0.1:
            continue  # where the QP's inverse is damped
        assert np.linalg.norm(best.eps) <= np.linalg.norm(geometric.eps) + 1e-7
        better += bool(np.linalg.norm(best.eps) < np.linalg.norm(geometric.eps) - 1e-3)
        if len(geometric.active) == 1 and geometric.iterations == 2:
            same += 1
            np.testing.assert_allclose(geometric.qd, best.qd, atol=1e-8)
    assert same >= 10
    assert better >= 1, "the thesis's reason for a QP shows"


def test_bounds_count_from_what_drift_compensation_asks_for() -> None:
    robot = arm("lbr_med14")
    q = np.deg2rad([10.0, 30.0, 5.0, -119.99, -5.0, 60.0, 0.0])
    drift = np.array([0.0, 0.002, -0.001])
    lower, upper = bounds_at(robot, q)
    for name in ("geometric-scaling", "geometric-clamping"):
        result = make_step(robot, name, "fix-orientation")(q, [-0.3, 0.1, 0.0], v_fixed=drift)
        assert result.status is Status.SOLVED
        assert result.active
        np.testing.assert_allclose(robot.jacobian(q)[3:] @ result.qd, drift, atol=1e-12)
        assert (result.qd <= upper + 1e-9).all()
        assert (result.qd >= lower - 1e-9).all()
