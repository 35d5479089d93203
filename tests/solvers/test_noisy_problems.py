"""Small problems near zero: no wrong "solved", no false "infeasible", hardly any given up."""

from collections import Counter

import numpy as np
import pytest

from kinqp.solvers import QP, Solution, Status, get_solver
from kinqp.solvers.catalogue import CATALOGUE, KnownQP
from tests.solvers.noisy_problems import contradiction, draw
from tests.solvers.referee import cost_size

#: A row may be out by this, relative to its terms, with each x at least 1.
OUTSIDE = 1e-8
#: What contradicts itself by less, relative to the rows' entries, may not be called infeasible.
NOISE = 3.7e-9
REFERENCES = ("clarabel", "qpsolvers:daqp")


def outside(qp: QP, x: np.ndarray) -> np.ndarray:
    activity = qp.stacked @ x
    return np.maximum(np.maximum(activity - qp.upper, qp.lower - activity), 0)


def fault(qp: QP, solution: Solution) -> str:
    """Say what is wrong with an answer; empty: nothing."""
    if solution.solved:
        terms = np.abs(qp.stacked) @ (1 + np.abs(solution.x))
        worst = float((outside(qp, solution.x) / np.where(terms > 0, terms, 1)).max())
        return "" if worst <= OUTSIDE else f"solved with a row out by {worst:.1e}"
    if solution.status is Status.PRIMAL_INFEASIBLE:
        size = contradiction(qp)
        return "" if size > NOISE else f"called infeasible, but rows contradict each other by {size:.1e} only"
    if solution.status is Status.DUAL_INFEASIBLE:
        proof = solution.certificate
        return "" if proof is not None and proof.proves(qp) else "called unbounded without a proof"
    return ""


def cheaper(qp: QP, solution: Solution, other: Solution) -> bool:
    """Whether another solver has found a point that is cheaper by more than what it is outside explains."""
    allowed = np.abs(np.concatenate((solution.y, solution.z, solution.z_box))) @ outside(qp, other.x)
    excess = qp.objective(solution.x) - qp.objective(other.x) - allowed
    return bool(excess > 1e-8 * (cost_size(qp, solution.x) + cost_size(qp, other.x)))


def check(seed: int, count: int, every: int) -> None:
    """Solve `count` problems, every `every`-th of them with the references, too."""
    rng = np.random.default_rng(seed)
    solver, references = get_solver("active-set"), [get_solver(name) for name in REFERENCES]
    seen: Counter[str] = Counter()
    wrong: list[str] = []
    for number in range(count):
        problem = draw(rng)
        qp = problem.qp
        solution = solver.solve(qp)
        seen[solution.status.value] += 1
        if found := fault(qp, solution):
            wrong.append(f"{seed}, {number} ({problem.kind}, noise {problem.noise:.1e}): {found}")
        for reference in references if number % every == 0 else ():
            other = reference.solve(qp)
            if solution.solved and other.solved:
                seen[reference.name] += 1
                if cheaper(qp, solution, other):
                    wrong.append(f"{seed}, {number} ({problem.kind}): {reference.name} is cheaper")
    report = f"{dict(seen)}: {wrong[:20]}"
    assert not wrong, report
    given_up = seen["inaccurate"] + seen["failed"] + seen["max_iterations"]
    assert given_up <= max(1, count // 1000), report
    assert seen["solved"] >= 0.8 * count, report
    assert seen["primal_infeasible"] >= 0.01 * count, report
    for name in REFERENCES:
        assert seen[name] >= 0.6 * count // every, report


def test_noisy_problems() -> None:
    check(1, 1_000, every=20)


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 3])
def test_more_noisy_problems(seed: int) -> None:
    check(seed, 20_000, every=10)


@pytest.mark.parametrize("noise", [0.0, 1e-17, 1e-13, 1e-9, -1e-9])
def test_noise_where_zero_is_meant(noise: float) -> None:
    """Two rows that are one, as those of an arm in a singular pose; what rounding left of zero contradicts itself."""
    solver = get_solver("active-set")
    assert solver.solve(QP(H=np.eye(3), g=[0, 0, 0], A=[[1, 2, -1], [2, 4, -2]], b=[0, noise])).solved
    solution = solver.solve(QP(H=np.eye(3), g=[-1, -1, 2], C=[[1, 2, -1], [-1, -2, 1]], u=[0, noise]))
    assert solution.solved
    # (1, 1, -2) projected on x0 + 2 x1 - x2 = 0.
    np.testing.assert_allclose(solution.x, [1 / 6, -2 / 3, -7 / 6], atol=1e-8)


@pytest.mark.parametrize("size", [1e-7, 1e-3, 1.0])
def test_what_contradicts_itself_by_more_is_infeasible(size: float) -> None:
    solver = get_solver("active-set")
    for factor in (1.0, 1e-6, 1e6):
        qp = QP(H=np.eye(3), g=[1, 0, 0], A=[[1, 2, -1], [2 * factor, 4 * factor, -2 * factor]], b=[0, size * factor])
        solution = solver.solve(qp)
        assert solution.status is Status.PRIMAL_INFEASIBLE
        assert solution.told_the_truth


@pytest.mark.parametrize("known", [known for known in CATALOGUE if known.x is not None], ids=lambda known: known.name)
def test_rows_given_again_with_noise_leave_the_answer(known: KnownQP) -> None:
    """Each row once more, doubled, its bounds off by noise; and a row of zeros."""
    rng = np.random.default_rng(4)
    solver, qp = get_solver("active-set"), known.qp
    for noise in (1e-17, 1e-15, 1e-12, 1e-9):
        for _ in range(5):
            off = [2 * noise * np.abs(rows).sum(axis=1) * rng.uniform(-1, 1, len(rows)) for rows in (qp.A, qp.C)]
            again = QP.trusted(
                H=qp.H,
                g=qp.g,
                A=np.vstack((qp.A, 2 * qp.A, np.zeros((1, qp.n)))),
                b=np.concatenate((qp.b, 2 * qp.b + off[0], [noise])),
                C=np.vstack((qp.C, 2 * qp.C, np.zeros((1, qp.n)))),
                l=np.concatenate((qp.l, 2 * qp.l + off[1], [-1])),
                u=np.concatenate((qp.u, 2 * qp.u + off[1], [-noise])),
                lb=qp.lb,
                ub=qp.ub,
            )
            solution = solver.solve(again)
            assert solution.solved, solution.message
            assert qp.objective(solution.x) == pytest.approx(qp.objective(known.x), rel=1e-7, abs=1e-6)
            if known.x_unique:
                np.testing.assert_allclose(solution.x, known.x, rtol=1e-5, atol=1e-5)
