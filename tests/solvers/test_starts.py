"""Starts, and what a solution says of how it was found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinqp.solvers import QP, OptionError, Status, available_solvers, get_solver

if TYPE_CHECKING:
    from numpy.typing import NDArray

TIMED = {
    "clarabel", "piqp", "casadi-qrqp", "qpsolvers:clarabel", "qpsolvers:osqp", "qpsolvers:scs", "cvxpy:CLARABEL",
}  # fmt: skip
# PIQP's timer runs only if it is asked to, which cvxpy does not do: it reads zero, and that is no time.
UNTIMED = {"active-set", "thesis-active-set", "qpsolvers:daqp", "qpsolvers:quadprog", "cvxpy:PIQP"}
# qpsolvers does not pass their counts on.
UNCOUNTED = {"qpsolvers:clarabel", "qpsolvers:daqp", "qpsolvers:highs"}


def problem(shift: float) -> QP:
    """Two of four variables on their bounds at (1, 1, ...); which ones does not change with small shifts."""
    g: NDArray[np.float64] = np.array([-3.0, -2.0, -0.5, 0.25]) + shift
    return QP(H=np.eye(4), g=g, C=[[1.0, 1.0, 1.0, 1.0]], l=[-5.0], u=[5.0], lb=-np.ones(4), ub=np.ones(4),
              x_feasible=np.zeros(4))  # fmt: skip


@pytest.mark.parametrize(
    ("solver", "start"),
    [(name, start) for name in available_solvers(bridges=True) for start in get_solver(name).starts],
)
def test_a_warm_start_gives_the_same_answers(solver: str, start: str) -> None:
    assert start in ("active-set", "solution")
    cold, warm = get_solver(solver), get_solver(solver, **get_solver(solver).starts[start])
    spent = [0, 0]
    for shift in np.linspace(0.0, 0.05, 6):
        qp = problem(shift)
        expected = np.clip(-qp.g, -1.0, 1.0)
        for index, each in enumerate((cold, warm)):
            solution = each.solve(qp)
            assert solution.status is Status.SOLVED, solution.message
            np.testing.assert_allclose(solution.x, expected, atol=1e-6)
            spent[index] += solution.iterations
    if solver in ("active-set", "casadi-qrqp"):
        assert spent[1] < spent[0]


def test_those_that_have_other_starts_are_known() -> None:
    assert set(get_solver("active-set").starts) == {"active-set"}
    assert set(get_solver("casadi-qrqp").starts) == set(get_solver("qpsolvers:osqp").starts) == {"solution"}
    assert not get_solver("piqp").starts
    with pytest.raises(OptionError, match="warm must be false"):
        get_solver("qpsolvers:quadprog", warm=True)


@pytest.mark.parametrize("solver", sorted(TIMED | UNTIMED))
def test_a_solution_tells_set_up_from_update_and_the_solvers_own_time(solver: str) -> None:
    made = get_solver(solver)
    first, second = made.solve(problem(0.0)), made.solve(problem(0.01))
    assert (first.updated, second.updated) == (False, True)
    made.reset()
    assert not made.solve(problem(0.02)).updated
    if solver in UNTIMED:
        assert second.own_time is None
    else:
        assert second.own_time is not None
        # In the same unit, of a span within what was measured from outside; Clarabel's has its last set-up in it.
        assert 0.0 < second.own_time <= second.solve_time + first.setup_time


@pytest.mark.parametrize("solver", sorted(TIMED | UNTIMED | UNCOUNTED))
def test_no_count_is_not_a_count_of_zero(solver: str) -> None:
    solution = get_solver(solver).solve(problem(0.0))
    if solver in UNCOUNTED:
        assert solution.iterations is None
    else:
        assert solution.iterations is not None
        assert solution.iterations >= 0


def test_a_timer_that_holds_more_than_the_solve_says_so() -> None:
    assert get_solver("piqp").own_timer == get_solver("casadi-qrqp").own_timer == "the solve"
    assert "set-up" in get_solver("clarabel").own_timer
    assert "set-up" in get_solver("qpsolvers:osqp").own_timer
