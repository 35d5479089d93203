"""Random QPs, compared with solvers that share no code with ours or with each other."""

import cvxpy
import daqp
import numpy as np
import pytest
import quadprog
from hypothesis import given, settings
from hypothesis import strategies as st

from kinqp.solvers import QP, available_solvers, get_solver

# Strictly convex problems with a feasible start and rows in general position are within reach of every solver, but for
# one that runs in circles, see test_casadi_qrqp.py.
SOLVERS = tuple(name for name in available_solvers() if name != "casadi-qrqp")


def random_qp(seed: int, n: int, m_eq: int, m: int, box: bool) -> QP:
    """Draw a strictly convex QP with two-sided, one-sided and absent bounds around a known interior point."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    A, C, inside = rng.normal(size=(m_eq, n)), rng.normal(size=(m, n)), rng.normal(size=n)
    low, high = C @ inside - rng.uniform(0.1, 2, m), C @ inside + rng.uniform(0.1, 2, m)
    low[rng.random(m) < 0.3] = -np.inf
    high[rng.random(m) < 0.3] = np.inf
    return QP(
        H=root @ root.T + 0.5 * np.eye(n),
        g=5 * rng.normal(size=n),
        A=A,
        b=A @ inside,
        C=C,
        l=low,
        u=high,
        lb=inside - rng.uniform(0.1, 2, n) if box else None,
        ub=inside + rng.uniform(0.1, 2, n) if box else None,
        x_feasible=inside,
    )


def by_quadprog(qp: QP) -> np.ndarray:
    rows, sides = [qp.A], [qp.b]
    for sign, bound in ((1.0, qp.lower), (-1.0, qp.upper)):
        kept = np.flatnonzero(np.isfinite(bound) & (qp.lower != qp.upper))
        rows.append(sign * qp.stacked[kept])
        sides.append(sign * bound[kept])
    G = np.vstack(rows).T.copy()
    # quadprog copies nothing and takes no empty arrays.
    constraints = (G, np.concatenate(sides), qp.m_eq) if G.size else ()
    answer: np.ndarray = quadprog.solve_qp(qp.H.copy(), -qp.g, *constraints)[0]
    return answer


def by_daqp(qp: QP) -> np.ndarray:
    sense = np.where(qp.lower == qp.upper, 5, 0).astype(np.intc)
    limit = np.clip([qp.lower, qp.upper], -1e30, 1e30)
    x, _, flag, _ = daqp.solve(qp.H.copy(), qp.g.copy(), qp.stacked.copy(), limit[1], limit[0], sense)
    assert flag == 1
    return np.asarray(x)


@pytest.mark.parametrize("name", SOLVERS)
@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**31),
    n=st.integers(1, 8),
    m_eq=st.integers(0, 3),
    m=st.integers(0, 8),
    box=st.booleans(),
)
def test_agrees_with_quadprog_and_daqp(name: str, seed: int, n: int, m_eq: int, m: int, box: bool) -> None:
    qp = random_qp(seed, n, min(m_eq, n - 1), m, box)
    solution = get_solver(name).solve(qp)
    assert solution.solved, solution.message
    for other in (by_quadprog(qp), by_daqp(qp)):
        # 1e-5: what a gap of 1e-9 leaves on rows that are only just active.
        np.testing.assert_allclose(solution.x, other, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("seed", range(20))
def test_multipliers_have_the_sign_of_the_active_side(name: str, seed: int) -> None:
    qp = random_qp(seed, 5, 1, 6, box=True)
    solution = get_solver(name).solve(qp)
    multipliers = np.concatenate((solution.z, solution.z_box))
    activity = (qp.stacked @ solution.x)[qp.m_eq :]
    low, high = qp.lower[qp.m_eq :], qp.upper[qp.m_eq :]
    assert (np.abs(activity - high)[multipliers > 1e-5] < 1e-5).all()
    assert (np.abs(activity - low)[multipliers < -1e-5] < 1e-5).all()
    assert (np.abs(multipliers) > 1e-5).any()
    gradient = qp.H @ solution.x + qp.g
    total = gradient + qp.A.T @ solution.y + qp.C.T @ solution.z + solution.z_box
    assert np.abs(total).max() < 1e-7


@pytest.mark.parametrize("name", SOLVERS)
def test_agrees_with_cvxpy_in_primal_and_dual(name: str) -> None:
    qp = random_qp(3, 4, 1, 5, box=True)
    x = cvxpy.Variable(4)
    upper, lower = np.flatnonzero(np.isfinite(qp.u)), np.flatnonzero(np.isfinite(qp.l))
    constraints = [
        qp.A @ x == qp.b,
        qp.C[upper] @ x <= qp.u[upper],
        qp.C[lower] @ x >= qp.l[lower],
        x <= qp.ub,
        x >= qp.lb,
    ]
    problem = cvxpy.Problem(cvxpy.Minimize(0.5 * cvxpy.quad_form(x, cvxpy.psd_wrap(qp.H)) + qp.g @ x), constraints)
    problem.solve(solver=cvxpy.CLARABEL)
    solution = get_solver(name).solve(qp)
    z = np.zeros(5)
    z[upper] += constraints[1].dual_value
    z[lower] -= constraints[2].dual_value
    np.testing.assert_allclose(solution.x, x.value, atol=1e-5)
    np.testing.assert_allclose(solution.y, constraints[0].dual_value, atol=1e-4)
    np.testing.assert_allclose(solution.z, z, atol=1e-4)
    np.testing.assert_allclose(solution.z_box, constraints[3].dual_value - constraints[4].dual_value, atol=1e-4)
    assert qp.objective(solution.x) == pytest.approx(problem.value, rel=1e-6)
