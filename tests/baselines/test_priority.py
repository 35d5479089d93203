"""Tasks in order: eq. 3.2 itself, its strictness, rank tolerance, and the hard stop."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinqp.baselines import RANK_TOLERANCE, TaskPriority, prioritise
from kinqp.baselines.linear import factor
from tests.baselines.planar import planar_jacobian, situation

ALL = np.eye(3)


def test_two_tasks_by_hand() -> None:
    """First qd_0 = 1; then qd_0 + qd_1 + qd_2 = 2 leaves 1, which the other two share."""
    tasks = [(np.array([[1.0, 0.0, 0.0]]), np.array([1.0])), (np.array([[1.0, 1.0, 1.0]]), np.array([2.0]))]
    found = prioritise(tasks, ALL)
    np.testing.assert_allclose(found.qd, [1.0, 0.5, 0.5], atol=1e-15)
    np.testing.assert_allclose(np.abs(found.null[:, 0]), [0.0, np.sqrt(0.5), np.sqrt(0.5)], atol=1e-15)


def test_four_tasks_by_hand() -> None:
    """The third contradicts the first two and gets nothing; the fourth takes what self-motion they leave."""
    tasks = [
        (np.array([[1.0, 0.0, 0.0]]), np.array([1.0])),
        (np.array([[0.0, 1.0, 0.0]]), np.array([2.0])),
        (np.array([[1.0, 1.0, 0.0]]), np.array([99.0])),
        (np.array([[5.0, 5.0, 2.0]]), np.array([16.0])),
    ]
    np.testing.assert_allclose(prioritise(tasks, ALL).qd, [1.0, 2.0, 0.5], atol=1e-14)


@given(seed=st.integers(0, 2**32 - 1), sizes=st.lists(st.integers(1, 4), min_size=1, max_size=4))
@settings(max_examples=50, deadline=None)
def test_it_is_equation_3_2_and_strict(seed: int, sizes: list[int]) -> None:
    """Against projectors and pseudo-inverses written out; and no task touches those before it, feasible or not."""
    rng = np.random.default_rng(seed)
    nv = 7
    tasks = [(rng.normal(size=(m, nv)), rng.normal(size=m)) for m in sizes]
    qd, above = np.zeros(nv), np.zeros((0, nv))
    for J, xd in tasks:
        P = np.eye(nv) - np.linalg.pinv(above, rcond=1e-9) @ above if len(above) else np.eye(nv)
        projected = J @ P
        # Where nothing is left but rounding, the pseudo-inverse of rounding is not what is meant.
        weak = np.linalg.norm(projected) < 1e-9
        qd = qd if weak else qd + np.linalg.pinv(projected, rcond=1e-9) @ (xd - J @ qd)
        above = np.vstack((above, J))
    found = prioritise(tasks, np.eye(nv)).qd
    np.testing.assert_allclose(found, qd, atol=1e-8 * (1.0 + np.abs(qd).max()))
    for k in range(len(tasks)):
        shorter = prioritise(tasks[: k + 1], np.eye(nv)).qd
        J = tasks[k][0]
        np.testing.assert_allclose(J @ found, J @ shorter, atol=1e-10 * (1.0 + np.abs(found).max()))


@pytest.mark.parametrize("sine", [1e-4, 1e-8, 1e-9])
def test_a_task_close_to_the_span_of_the_one_before_does_not_disturb_it(sine: float) -> None:
    first, second = np.array([[1.0, 2.0, 3.0]]), np.array([[1.0, 2.0, 3.0]]) + sine * np.array([[1.0, 0.0, 0.0]])
    qd = prioritise([(first, np.array([0.0])), (second, np.array([1.0]))], ALL).qd
    assert np.abs(qd).max() > 0.1 / sine
    assert abs(first @ qd).max() <= 1e-14 * np.abs(qd).max()


def test_rank_is_counted_against_the_matrix_before_the_projection() -> None:
    row = np.array([[3.0, 4.0, 0.0]])
    rounding = 1e-16 * np.ones((1, 3))
    assert factor(rounding).rank == 1
    assert factor(rounding, 5.0).rank == 0
    assert factor(np.diag([1.0, 0.5 * RANK_TOLERANCE])).rank == 1
    assert factor(np.diag([1.0, 2.0 * RANK_TOLERANCE])).rank == 2
    qd = prioritise([(row, np.array([5.0])), (2.0 * row, np.array([0.0]))], ALL).qd
    np.testing.assert_allclose(qd, [0.6, 0.8, 0.0], atol=1e-15)


def test_a_joint_that_would_pass_its_limit_is_frozen_by_its_column() -> None:
    """Three unit links, stretched along x after a right angle; the tip pulled along y needs joint 0 least of all.

    J_y = (1, 1, ...): with joints equal in the row, least norm gives each a third. Joint 1 sits on its limit: the other
    two do it all, a half each, and the task is still done. Zeroing the task's row instead would do nothing at all.
    """
    J = np.array([[1.0, 1.0, 1.0]])
    q = np.array([0.0, 1.0, 0.0])
    found = TaskPriority().resolve(situation(J, [0.3], q=q))
    np.testing.assert_allclose(found.qd, [0.15, 0.0, 0.15], atol=1e-16)
    assert found.active == ("joint limits[1] upper",)
    assert found.iterations == 2
    away = TaskPriority().resolve(situation(J, [-0.3], q=q))
    np.testing.assert_allclose(away.qd, [-0.1, -0.1, -0.1], atol=1e-16)
    assert away.active == ()
    without = TaskPriority(limits="none").resolve(situation(J, [0.3], q=q))
    np.testing.assert_allclose(without.qd, [0.1, 0.1, 0.1], atol=1e-16)


def test_freezing_one_joint_may_take_another_to_its_limit() -> None:
    """Joint 0 is on its limit; without it joint 1, 0.12 mrad from its own, has to go faster, and is frozen too."""
    J = np.array([[1.0, 1.0, 1.0]])
    found = TaskPriority().resolve(situation(J, [0.3], q=np.array([1.0, 1.0 - 1.2e-4, 0.0])))
    np.testing.assert_allclose(found.qd, [0.0, 0.0, 0.3], atol=1e-16)
    assert found.iterations == 3
    assert found.active == ("joint limits[0] upper", "joint limits[1] upper")


def test_a_joint_beyond_its_limit_may_come_back() -> None:
    J = np.eye(3)
    q = np.array([1.5, -1.5, 1.5])
    found = TaskPriority().resolve(situation(J, [-0.2, 0.2, 0.2], q=q))
    np.testing.assert_allclose(found.qd, [-0.2, 0.2, 0.0], atol=1e-16)


def test_locked_rows_hold_with_a_joint_frozen() -> None:
    """Planar arm of four links, orientation locked (1, 1, 1, 1): the frozen joint's column is out of both tasks."""
    q = np.array([0.3, 1.0, -0.4, -0.2])
    J = planar_jacobian(q)
    at = situation(J, -0.2 * J[:, 1] / np.linalg.norm(J[:, 1]), J_fixed=np.ones((1, 4)), q=q)
    free = TaskPriority(limits="none").resolve(at)
    sign = np.sign(free.qd[1])
    at = situation(J, sign * at.v, J_fixed=np.ones((1, 4)), q=q)
    found = TaskPriority().resolve(at)
    assert found.qd[1] == 0.0
    assert abs(found.qd.sum()) < 1e-14
    np.testing.assert_allclose(J @ found.qd, at.v, atol=1e-13)


def test_a_posture_is_the_last_task() -> None:
    J = np.array([[1.0, 1.0, 1.0]])
    q = np.array([0.4, -0.2, 0.1])
    found = TaskPriority(posture_gain=2.0).resolve(situation(J, [0.3], q=q))
    # -2 q less its mean, on top of 0.1 each.
    np.testing.assert_allclose(found.qd, 0.1 - 2.0 * (q - q.mean()), atol=1e-15)
