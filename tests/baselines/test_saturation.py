"""Saturation in the null space: by hand, against linear and quadratic programming, and as the QP `task-scaling`."""

import numpy as np
import pytest
import quadprog
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from kinqp.baselines import saturate_tasks
from kinqp.control import make_step
from kinqp.formulations import Mode
from kinqp.solvers import Status
from tests.formulations.reference import adversarial_state
from tests.robots.arms import arm

BOTH = ("basic", "optimal")


@pytest.mark.parametrize("variant", BOTH)
def test_the_others_make_up_for_a_saturated_joint(variant: str) -> None:
    """1 + 1 + 1 = 3 is the least norm; joint 0 may do a half only, the other two share what is left."""
    J, bound = np.ones((1, 3)), np.array([0.5, 2.0, 2.0])
    (level,) = saturate_tasks([(J, np.array([3.0]))], -bound, bound, variant=variant)
    np.testing.assert_allclose(level.qd, [0.5, 1.25, 1.25], atol=1e-14)
    assert level.scale == 1.0
    np.testing.assert_array_equal(level.held, [1.0, 0.0, 0.0])


@pytest.mark.parametrize("variant", BOTH)
def test_joints_all_saturated_leave_the_largest_scale(variant: str) -> None:
    """At most 0.5 + 1 of the 3 asked for; downwards 0.25 + 1."""
    J, upper, lower = np.ones((1, 2)), np.array([0.5, 1.0]), np.array([-0.25, -1.0])
    (up,) = saturate_tasks([(J, np.array([3.0]))], lower, upper, variant=variant)
    np.testing.assert_allclose(up.qd, [0.5, 1.0], atol=1e-14)
    assert up.scale == pytest.approx(0.5, abs=1e-14)
    (down,) = saturate_tasks([(J, np.array([-3.0]))], lower, upper, variant=variant)
    np.testing.assert_allclose(down.qd, [-0.25, -1.0], atol=1e-14)
    assert down.scale == pytest.approx(1.25 / 3.0, abs=1e-14)


@pytest.mark.parametrize("variant", BOTH)
def test_a_joint_on_its_limit_that_the_task_needs_stops_all(variant: str) -> None:
    """Two joints, two rows: the second joint alone could still move, but not in the direction asked for."""
    (level,) = saturate_tasks(
        [(np.eye(2), np.array([1.0, 1.0]))], np.full(2, -1.0), np.array([0.0, 1.0]), variant=variant
    )
    assert level.scale == 0.0
    np.testing.assert_array_equal(level.qd, [0.0, 0.0])
    np.testing.assert_array_equal(level.held, [1.0, 0.0])


@pytest.mark.parametrize("variant", BOTH)
def test_the_second_task_gives_way_to_the_first(variant: str) -> None:
    """First qd_0 + qd_1 = 1; then qd_1 = 1, of which its bound leaves 0.75, and joint 0 goes back by as much."""
    tasks = [(np.array([[1.0, 1.0, 0.0]]), np.array([1.0])), (np.array([[0.0, 1.0, 0.0]]), np.array([1.0]))]
    first, second = saturate_tasks(tasks, np.array([-1.0, -1.0, -1.0]), np.array([1.0, 0.75, 1.0]), variant=variant)
    np.testing.assert_allclose(first.qd, [0.5, 0.5, 0.0], atol=1e-14)
    np.testing.assert_allclose(second.qd, [0.25, 0.75, 0.0], atol=1e-14)
    assert second.scale == pytest.approx(0.5, abs=1e-14), "counted from what the first task does to the second: 0.5"


def test_what_was_saturated_too_early_is_released_by_the_optimal_variant() -> None:
    """A case in which the basic passes stop short of the largest scale, found at random and kept."""
    for seed in range(400):
        tasks, lower, upper = random_problem(seed)
        basic = saturate_tasks(tasks, lower, upper)[-1]
        optimal = saturate_tasks(tasks, lower, upper, variant="optimal")[-1]
        if basic.scale < optimal.scale - 0.05:
            assert optimal.scale == pytest.approx(largest_scale(tasks, lower, upper), abs=1e-9)
            return
    pytest.fail("expected the basic variant to fall short once in 400 problems")


def random_problem(seed: int) -> tuple[list[tuple[np.ndarray, np.ndarray]], np.ndarray, np.ndarray]:
    """A locked and a guided task; three joints in ten rest on a limit."""
    rng = np.random.default_rng(seed)
    nv = int(rng.integers(2, 8))
    m_fixed = int(rng.integers(0, max(1, nv - 1)))
    m_free = int(rng.integers(1, max(2, nv - m_fixed)))
    upper = rng.uniform(0.0, 1.0, nv) * (rng.random(nv) < 0.7)
    lower = -rng.uniform(0.0, 1.0, nv) * (rng.random(nv) < 0.7)
    v = rng.normal(size=m_free) * rng.choice([0.1, 1.0, 5.0])
    return [(rng.normal(size=(m_fixed, nv)), np.zeros(m_fixed)), (rng.normal(size=(m_free, nv)), v)], lower, upper


def largest_scale(tasks: list[tuple[np.ndarray, np.ndarray]], lower: np.ndarray, upper: np.ndarray) -> float:
    """The same by linear programming over (qd, s)."""
    (J_fixed, _), (J, v) = tasks
    rows = np.vstack((np.column_stack((J_fixed, np.zeros(len(J_fixed)))), np.column_stack((J, -v))))
    found = linprog(
        np.append(np.zeros(len(lower)), -1.0),
        A_eq=rows,
        b_eq=np.zeros(len(rows)),
        bounds=[*zip(lower, upper, strict=True), (0.0, 1.0)],
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return float(found.x[-1])


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=80, deadline=None)
def test_bounds_direction_and_locked_rows_hold_and_the_optimal_scale_is_the_largest(seed: int) -> None:
    tasks, lower, upper = random_problem(seed)
    (J_fixed, _), (J, v) = tasks
    most = largest_scale(tasks, lower, upper)
    for variant in BOTH:
        level = saturate_tasks(tasks, lower, upper, variant=variant)[-1]
        assert (level.qd <= upper + 1e-12).all()
        assert (level.qd >= lower - 1e-12).all()
        size = 1.0 + np.abs(v).max()
        np.testing.assert_allclose(J @ level.qd, level.scale * v, atol=1e-11 * size)
        np.testing.assert_allclose(J_fixed @ level.qd, 0.0, atol=1e-11)
        assert level.scale <= most + 1e-8
        if variant == "optimal":
            assert level.scale == pytest.approx(most, abs=1e-8)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=80, deadline=None)
def test_the_optimal_variant_has_the_least_norm_at_its_scale(seed: int) -> None:
    """By quadprog, given a hair more room than there is: at the largest scale the feasible set is often flat."""
    tasks, lower, upper = random_problem(seed)
    (J_fixed, _), (J, v) = tasks
    level = saturate_tasks(tasks, lower, upper, variant="optimal")[-1]
    nv = len(lower)
    rows, sides = np.vstack((J, J_fixed)), np.append(level.scale * v, np.zeros(len(J_fixed)))
    room = 1e-9
    least = quadprog.solve_qp(
        np.eye(nv),
        np.zeros(nv),
        np.vstack((rows, -np.eye(nv), np.eye(nv))).T,
        np.concatenate((sides, -upper - room, lower - room)),
        len(rows),
    )[0]
    assert np.linalg.norm(level.qd) <= np.linalg.norm(least) + 1e-5
    basic = saturate_tasks(tasks, lower, upper)[-1]
    if basic.scale >= level.scale - 1e-12:
        assert np.linalg.norm(level.qd) <= np.linalg.norm(basic.qd) + 1e-10


@pytest.mark.parametrize("text", ["position", "fix-orientation", "fix-position", "line:z"])
def test_the_optimal_variant_is_the_formulation_task_scaling(text: str) -> None:
    """Away from singularities, where that QP trades its two aims: the same command, joints on limits or not."""
    robot, mode = arm("lbr_med14"), Mode.parse(text)
    baseline = make_step(robot, "saturation-null-space(variant=optimal)", mode)
    formulation = make_step(robot, "task-scaling", mode)
    rng, compared = np.random.default_rng(3), 0
    for _ in range(60):
        q, v = adversarial_state(robot, rng), rng.normal(size=mode.m_free) * rng.choice([0.01, 0.3, 2.0])
        result, other = baseline(q, v), formulation(q, v, scale_threshold=1e-4)
        assert result.status is Status.SOLVED
        if other.status is Status.SOLVED and result.sigma_min > 0.05:
            compared += 1
            np.testing.assert_allclose(result.qd, other.qd, atol=2e-6)
    assert compared >= 20


def test_scaling_counts_from_what_drift_compensation_asks_for() -> None:
    """Locked: qd_0 = 0.2. Guided: qd_0 + qd_1 = 1 of which 0.2 is there already; joint 1 does 0.4 of the 0.8 left."""
    tasks = [(np.array([[1.0, 0.0]]), np.array([0.2])), (np.array([[1.0, 1.0]]), np.array([1.0]))]
    for variant in BOTH:
        level = saturate_tasks(tasks, np.full(2, -0.4), np.full(2, 0.4), variant=variant)[-1]
        np.testing.assert_allclose(level.qd, [0.2, 0.4], atol=1e-14)
        assert level.scale == pytest.approx(0.5, abs=1e-14)
