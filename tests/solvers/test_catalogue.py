"""Every solver on every problem whose answer is known."""

import numpy as np
import pytest

from kinqp.solvers import Status, available_solvers, get_solver
from kinqp.solvers.catalogue import CATALOGUE, KnownQP

# What a solver is known to get wrong: problem -> (what it claims, what we make of it). Whoever repairs one of these
# will find the test failing, and removes the line. Solvers without a line here must get everything right.
KNOWN_FAILURES: dict[str, dict[str, tuple[Status, Status] | None]] = {
    # It has no word for a problem without a solution, and takes small pivots for a singular system.
    "casadi-qrqp": dict.fromkeys(
        ("dependent-equalities", "tiny-row", "infeasible-rows", "infeasible-equality", "unbounded"),
        (Status.FAILED, Status.FAILED),
    ),
    "thesis-active-set": {
        "dependent-rows-at-start": (Status.FAILED, Status.FAILED),
        "dependent-equalities": (Status.FAILED, Status.FAILED),
        "equal-sides": (Status.FAILED, Status.FAILED),
        "semidefinite-unique": (Status.FAILED, Status.FAILED),
        "flat-valley": (Status.FAILED, Status.FAILED),
        "linear-programme": (Status.FAILED, Status.FAILED),
        "tiny-row": (Status.SOLVED, Status.INACCURATE),
        # How a nearly singular KKT system comes out depends on the rounding of the machine: a wrong answer that is
        # claimed to be solved, or a failure.
        "hidden-dependence": None,
        "beale": (Status.MAX_ITERATIONS, Status.MAX_ITERATIONS),
        "infeasible-rows": (Status.FAILED, Status.FAILED),
        "infeasible-equality": (Status.FAILED, Status.FAILED),
        "unbounded": (Status.FAILED, Status.FAILED),
    },
}

by_name = pytest.mark.parametrize("known", CATALOGUE, ids=lambda known: known.name)


def test_names_are_unique_and_failures_name_them() -> None:
    names = [known.name for known in CATALOGUE]
    assert len(names) == len(set(names)) >= 12
    for failures in KNOWN_FAILURES.values():
        assert set(failures) <= set(names)


@by_name
@pytest.mark.parametrize("name", available_solvers())
def test_solver_finds_the_known_answer(name: str, known: KnownQP) -> None:
    solution = get_solver(name).solve(known.qp)
    failures = KNOWN_FAILURES.get(name, {})
    if known.name in failures:
        assert not solution.solved
        assert failures[known.name] in (None, (solution.claimed, solution.status))
        assert solution.message
        return
    assert solution.status is known.status, solution.message
    assert solution.told_the_truth
    if known.status is not Status.SOLVED:
        assert solution.certificate is not None
        assert solution.certificate.proves(known.qp)
        return
    assert known.x is not None
    if known.x_unique:
        np.testing.assert_allclose(solution.x, known.x, rtol=0, atol=known.accuracy)
    assert known.qp.objective(solution.x) == pytest.approx(known.qp.objective(known.x), rel=1e-7, abs=1e-7)
    if known.dual_unique:
        for mine, theirs in ((solution.y, known.y), (solution.z, known.z), (solution.z_box, known.z_box)):
            np.testing.assert_allclose(mine, theirs, rtol=known.accuracy, atol=known.accuracy)


@by_name
def test_known_answer_satisfies_the_optimality_conditions(known: KnownQP) -> None:
    """Written out from the definition, row by row, not with the library's own residuals."""
    qp = known.qp
    if known.status is not Status.SOLVED:
        assert known.x is None
        return
    x, y, z, z_box = known.x, known.y, known.z, known.z_box
    assert x is not None
    assert y is not None
    assert z is not None
    assert z_box is not None
    size = 1e-12 * (1 + np.abs(qp.H).max() + np.abs(qp.g).max())
    assert np.abs(qp.H @ x + qp.g + qp.A.T @ y + qp.C.T @ z + z_box).max() <= size
    assert np.abs(qp.A @ x - qp.b).max(initial=0) <= 1e-12
    for value, low, high, multiplier in (
        *zip(qp.C @ x, qp.l, qp.u, z, strict=True),
        *zip(x, qp.lb, qp.ub, z_box, strict=True),
    ):
        assert low - 1e-12 <= value <= high + 1e-12
        if multiplier > 0:
            assert abs(value - high) <= 1e-12
        if multiplier < 0:
            assert abs(value - low) <= 1e-12


@by_name
def test_start_is_feasible(known: KnownQP) -> None:
    x = known.qp.x_feasible
    if x is None:
        assert known.status is Status.PRIMAL_INFEASIBLE or known.qp.upper.size == known.qp.n
        return
    activity = known.qp.stacked @ x
    assert (activity <= known.qp.upper).all()
    assert (activity >= known.qp.lower).all()
