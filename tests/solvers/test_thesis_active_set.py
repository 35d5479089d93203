"""The thesis's method in the exact form of appendix A.3, and its faults, pinned down so that nobody forgets them."""

import numpy as np
import pytest

from kinqp.solvers import QP, Status, get_solver
from kinqp.solvers.catalogue import CATALOGUE

KNOWN = {known.name: known for known in CATALOGUE}


def transcript(B: np.ndarray, c: np.ndarray, x: np.ndarray, cap: int = 100) -> tuple[np.ndarray, int, int]:
    """Follow A.3 line by line (identity Hessian, gradient x); return x, its k, and the passes of its loop."""
    active = np.full(len(B), np.nan)
    active[B @ x == c] = 1
    k = 0
    for passes in range(1, cap + 1):
        on = ~np.isnan(active)
        a, m = int(on.sum()), len(x)
        kkt = np.block([[np.eye(m), B[on].T], [B[on], np.zeros((a, a))]])
        answer = np.linalg.solve(kkt, np.concatenate((-x, np.zeros(a))))
        d, mu = answer[:m], np.zeros(len(B))
        mu[on] = answer[m:]
        if np.linalg.norm(d) < 1e-5:
            if (mu >= 0).all():
                return x, k, passes
            candidates = np.flatnonzero((mu < 0) & on)
            active[candidates[np.argmin(mu[candidates])]] = np.nan
        else:
            rows = np.flatnonzero(np.isnan(active) & (B @ d > 1e-6))
            steps = np.concatenate(([1.0], (c[rows] - B[rows] @ x) / (B[rows] @ d)))
            i = int(np.argmin(steps))
            x = x + steps[i] * d
            k += 1
            if steps[i] != 1:
                active[rows[i - 1]] = 1
    raise AssertionError("no convergence")


def cartesian_error_problem(seed: int) -> tuple[QP, np.ndarray, np.ndarray, np.ndarray]:
    """Draw the first formulation of the thesis, two-sided and as [J#; -J#], with its start eps = -v."""
    rng = np.random.default_rng(seed)
    J, v = rng.normal(size=(7, 3)), 2 * rng.normal(size=3)
    qd = J @ v
    limit = rng.uniform(0.2, 1.5, 7)
    two_sided = QP(H=np.eye(3), g=np.zeros(3), C=J, l=-limit - qd, u=limit - qd, x_feasible=-v)
    return two_sided, np.vstack((J, -J)), np.concatenate((limit - qd, limit + qd)), -v


@pytest.mark.parametrize("seed", range(40))
def test_follows_the_printed_algorithm_step_by_step(seed: int) -> None:
    qp, B, c, start = cartesian_error_problem(seed)
    x, k, passes = transcript(B, c, start)
    solution = get_solver("thesis-active-set").solve(qp)
    assert solution.solved
    np.testing.assert_allclose(solution.x, x, atol=1e-12)
    assert solution.iterations == passes
    assert k < passes, "A.3 counts steps only: the pass that finds the answer takes none"


@pytest.mark.parametrize("seed", range(40))
def test_two_sided_rows_and_the_stacked_form_are_the_same_problem(seed: int) -> None:
    qp, B, c, start = cartesian_error_problem(seed)
    stacked = QP(H=np.eye(3), g=np.zeros(3), C=B, u=c, x_feasible=start)
    solver = get_solver("thesis-active-set")
    two, one = solver.solve(qp), solver.solve(stacked)
    np.testing.assert_array_equal(two.x, one.x)
    np.testing.assert_array_equal(two.z, one.z[:7] - one.z[7:])
    assert two.iterations == one.iterations
    reference = get_solver("clarabel").solve(qp)
    np.testing.assert_allclose(two.x, reference.x, atol=1e-6)


def test_start_is_required_and_must_be_feasible() -> None:
    solver = get_solver("thesis-active-set")
    box = {"H": np.eye(1), "g": np.ones(1), "lb": np.zeros(1)}
    missing = solver.solve(QP(**box))
    assert missing.status is Status.FAILED
    assert "x_feasible, which is missing" in missing.message
    outside = solver.solve(QP(**box, x_feasible=[-1e-3]))
    assert outside.status is Status.FAILED
    assert "violates the constraints" in outside.message
    off = solver.solve(QP(H=np.eye(1), g=[0], A=[[1]], b=[1], x_feasible=[1.001]))
    assert "violates the constraints" in off.message
    assert solver.solve(QP(H=np.eye(1), g=[1])).solved, "without constraints any start will do"


def test_stops_up_to_1e_5_short_of_the_minimiser() -> None:
    qp = KNOWN["tiny-step"].qp
    printed = get_solver("thesis-active-set", tolerance=1e-5).solve(qp)
    assert printed.claimed is Status.SOLVED
    assert printed.status is Status.INACCURATE
    assert abs(printed.x[0] - 4e-6) == pytest.approx(4e-6)
    assert get_solver("thesis-active-set").solve(qp).solved


def test_ratio_test_overlooks_rows_with_small_entries() -> None:
    known = KNOWN["tiny-row"]
    printed = get_solver("thesis-active-set").solve(known.qp)
    assert printed.claimed is Status.SOLVED
    assert printed.status is Status.INACCURATE
    assert printed.x[0] == 1.0, "walked through the row at 0.5"
    repaired = get_solver("thesis-active-set", min_slope=1e-12).solve(known.qp)
    assert repaired.solved
    assert repaired.x[0] == pytest.approx(0.5)


@pytest.mark.parametrize("cap", [10, 100, 1000])
def test_endless_loop_on_beales_problem_ends_at_the_cap(cap: int) -> None:
    solution = get_solver("thesis-active-set", max_iterations=cap).solve(KNOWN["beale"].qp)
    assert solution.status is Status.MAX_ITERATIONS
    assert solution.iterations == cap
    np.testing.assert_array_equal(solution.x, 0)


def test_bound_missed_by_rounding_is_not_in_the_first_active_set() -> None:
    """A.3 compares B x0 == c exactly, so one rounding error in the start costs passes."""
    solver = get_solver("thesis-active-set")
    problem = {"H": np.eye(2), "g": np.array([-1.0, -0.5]), "C": np.array([[1.0, 0.0]]), "u": np.array([0.3])}
    exact = solver.solve(QP(**problem, x_feasible=[0.3, 0]))
    rounded = solver.solve(QP(**problem, x_feasible=[0.1 + 0.2, 0]))
    assert 0.1 + 0.2 != 0.3
    assert exact.solved
    assert rounded.solved
    assert rounded.iterations == exact.iterations + 1


@pytest.mark.parametrize("name", ["equal-sides", "dependent-equalities", "dependent-rows-at-start", "flat-valley"])
def test_singular_systems_are_failures_with_a_reason(name: str) -> None:
    solution = get_solver("thesis-active-set").solve(KNOWN[name].qp)
    assert solution.status is Status.FAILED
    assert "KKT matrix is singular" in solution.message


def test_dependent_rows_can_end_in_a_wrong_answer_that_only_our_check_finds() -> None:
    known = KNOWN["hidden-dependence"]
    solution = get_solver("thesis-active-set").solve(known.qp)
    assert not solution.solved
    if solution.claimed is Status.SOLVED:
        assert known.x is not None
        assert solution.residuals.gap > 0.1
        assert np.abs(solution.x - known.x).max() > 0.1
