"""The certified bound on the active set's steps: attained where it says, never passed by samples."""

from __future__ import annotations

import numpy as np
import pytest

from kinqp.benchmarks.iteration_bound import IterationBound, iteration_bound
from kinqp.control import make_step
from kinqp.robots import load_robot
from kinqp.solvers import QP, get_solver

Q = np.array([0.3, 0.7, -0.4, -1.6, 0.5, 0.9, -0.2])


def _inverse(mode: str) -> np.ndarray:
    """J# of `cartesian-error` on the LBR at `Q`."""
    step = make_step(load_robot("lbr_med14"), "cartesian-error", mode)
    v = np.ones(step.mode.m_free) * 0.05
    qp = step.evaluate(Q, v).qp
    if qp.C.size:
        return np.asarray(qp.C)
    # One variable: its rows went into the box, and J# is read off the command.
    base = step(Q, 1e-6 * v)
    return (base.qd / (1e-6 * v[0]))[:, None]


def _steps(M: np.ndarray, v: np.ndarray, low: np.ndarray, high: np.ndarray) -> int:
    task = M @ v
    n = M.shape[1]
    qp = QP(H=np.eye(n), g=np.zeros(n), C=M, l=low - task, u=high - task)
    solution = get_solver("active-set").solve(qp)
    assert solution.solved
    return solution.iterations


def _sampled(M: np.ndarray, count: int, about: IterationBound) -> int:
    """Most steps at states drawn anywhere and about the worst one."""
    rng = np.random.default_rng(1)
    nv, n = M.shape
    most = 0
    for index in range(count):
        v, low, high = rng.normal(size=n), -(10.0 ** rng.uniform(-4, 1, nv)), 10.0 ** rng.uniform(-4, 1, nv)
        if index % 2:
            share = 10.0 ** rng.uniform(-6, -1)
            v = about.v * (1.0 + share * rng.normal(size=n))
            low, high = (x * (1.0 + share * rng.uniform(-1, 1, nv)) for x in (about.qd_lo, about.qd_hi))
        most = max(most, _steps(M, v, low, high))
    return most


@pytest.mark.parametrize(
    "M",
    [
        pytest.param(_inverse("line:z"), id="line:z on the LBR"),
        pytest.param(np.random.default_rng(0).normal(size=(3, 2)), id="3 x 2"),
        pytest.param(np.random.default_rng(3).normal(size=(3, 3)), id="3 x 3"),
        pytest.param(_inverse("plane:0,1,0"), id="plane on the LBR", marks=pytest.mark.long),
    ],
)
def test_the_bound_is_attained_and_never_passed(M: np.ndarray) -> None:
    bound = iteration_bound(M)
    assert bound.margin > 0.0
    assert (bound.qd_lo <= 0.0).all()
    assert (bound.qd_hi >= 0.0).all()
    assert _steps(M, bound.v, bound.qd_lo, bound.qd_hi) == bound.iterations
    assert _sampled(M, 2_000, bound) == bound.iterations


def test_one_row_takes_one_step_and_one_direction_at_most_as_many_as_rows() -> None:
    assert iteration_bound([[2.0]]).iterations == 1
    # By hand: in one direction the farthest row alone is outside last; entering it satisfies all others.
    assert iteration_bound([[1.0], [0.5], [-2.0]]).iterations == 1


@pytest.mark.parametrize(
    ("M", "message"),
    [
        (np.zeros((0, 2)), "expected a finite matrix"),
        ([[1.0, np.nan]], "expected a finite matrix"),
        ([[1.0, 0.0], [0.0, 0.0]], "got zero in row 1"),
        ([[1.0, 1.0], [2.0, 2.0], [0.0, 1.0]], r"any 2 rows to be independent"),
    ],
)
def test_what_rounding_would_decide_is_refused(M: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        iteration_bound(M)
