"""CasADi's QRQP: right when it answers, and it says so when it runs in circles."""

import numpy as np
import pytest

from kinqp.solvers import QP, OptionError, Status, get_solver
from tests.solvers.test_solver import control_problem

INFEASIBLE = QP(H=np.eye(1), g=[0], C=[[1], [1]], l=[1, -3], u=[2, -2])


@pytest.mark.parametrize(("n", "m", "least"), [(4, 7, 0.85), (7, 14, 0.5)])
def test_what_it_calls_solved_is_right_and_the_rest_it_admits(n: int, m: int, least: float) -> None:
    solver, reference = get_solver("casadi-qrqp"), get_solver("clarabel")
    solved = 0
    for seed in range(120):
        qp = control_problem(seed, n, m)
        solution = solver.solve(qp)
        if not solution.solved:
            assert solution.claimed in (Status.MAX_ITERATIONS, Status.FAILED)
            assert solution.message.startswith("QRQP reports")
            continue
        solved += 1
        assert solution.residuals.worst_scaled < 1e-12
        other = reference.solve(qp)
        for mine, theirs in ((solution.x, other.x), (solution.y, other.y), (solution.z, other.z)):
            np.testing.assert_allclose(mine, theirs, rtol=1e-4, atol=1e-4)
    assert least <= solved / 120 < 1.0


def test_it_is_quiet_and_counts_iterations(capfd: pytest.CaptureFixture[str]) -> None:
    solver = get_solver("casadi-qrqp", max_iterations=2)
    easy = solver.solve(QP(H=np.eye(1), g=[-1], ub=[0.5]))
    assert easy.solved
    assert easy.iterations >= 1
    hard = solver.solve(control_problem(0, 7, 14))
    assert hard.status is Status.MAX_ITERATIONS
    assert get_solver("casadi-qrqp").solve(INFEASIBLE).status is Status.FAILED
    assert capfd.readouterr() == ("", "")


def test_settings_reach_casadi_or_are_refused() -> None:
    qp = control_problem(0, 7, 14)
    assert get_solver("casadi-qrqp", settings={"max_iter": 3}).solve(qp).status is Status.MAX_ITERATIONS
    with pytest.raises(OptionError, match=r"casadi-qrqp does not accept the settings .*nonsense"):
        get_solver("casadi-qrqp", settings={"nonsense": 1})
