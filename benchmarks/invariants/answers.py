"""Interpreted steps on many states: their commands, and their solvers' answers measured once more."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np

from ...control import BOUND_TOLERANCE, FIXED_TOLERANCE, InterpretedStep
from ...formulations import InputError
from ...solvers import Status
from ...solvers.residuals import residuals
from ...solvers.solution import JUDGE_TOLERANCE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ...formulations import Formulation, Mode
    from ...robots import Robot
    from ...solvers import QP, Solution, Solver
    from .states import StateSet
    from .tally import Row

    Array = NDArray[np.float64]

#: Above what the step itself allows: its Jacobian and bounds differ from the ones here by rounding.
MARGIN: Final = 1.001
#: Cost above the best known, relative to the objective's two parts, at least 1 [m^2/s^2 at unit weights].
COST_TOLERANCE: Final = 1e-6
#: Inputs that tell of the ticks before, by the names they have in `StateSet`.
MEMORY: Final[tuple[str, ...]] = ("qd_prev", "qdd_prev")
_ERROR_TOLERANCE: Final = 1e-9


class Recorder:
    """Stands for a solver in a step: passes QPs on to the one it is given, and keeps what was solved."""

    def __init__(self) -> None:
        self.solver: Solver | None = None
        self.solved: list[tuple[QP, Solution]] = []

    def solve(self, qp: QP) -> Solution:
        """Solve, and keep both."""
        if self.solver is None:
            raise RuntimeError("recorder: expected a solver first, got none")
        solution = self.solver.solve(qp)
        self.solved.append((qp, solution))
        return solution


def recorded_step(robot: Robot, formulation: Formulation, mode: Mode) -> tuple[InterpretedStep, Recorder]:
    """Make a step whose solver can be exchanged, lowered once."""
    recorder = Recorder()
    # A step asks nothing of its solver but solve(qp).
    return InterpretedStep(robot, formulation, mode, cast("Solver", recorder)), recorder


@dataclass
class Answers:
    """What a solver made of N states.

    Attributes
    ----------
    qd, eps : ndarray, shapes (N, nv) and (N, m_free)
        Commands and errors, NaN where the call raised.
    status : list of Status
    claimed : list of Status
        What the solver said.
    raised : list of str
        What was raised, or "".
    told : list of bool
        Whether a refusal came with a message.
    residual : ndarray, shape (N,)
        Largest scaled residual of the answers used, over the levels; 0 where refused.
    cost, scale : ndarray, shape (N,)
        Objective of the first level's QP, NaN where refused; and what it is judged relative to.
    price : ndarray, shape (N,)
        Sum of its multipliers' sizes: what rows missed by one may change of the cost.
    missed : ndarray, shape (N,)
        Largest violation of its rows.
    """

    qd: Array
    eps: Array
    residual: Array
    cost: Array
    scale: Array
    price: Array
    missed: Array
    status: list[Status] = field(default_factory=list)
    claimed: list[Status] = field(default_factory=list)
    raised: list[str] = field(default_factory=list)
    told: list[bool] = field(default_factory=list)

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Which were solved, shape (N,)."""
        return np.array([status is Status.SOLVED for status in self.status], dtype=bool)


def inputs_of(names: tuple[str, ...], states: StateSet, index: int, given: Mapping[str, ArrayLike]) -> dict[str, Any]:
    """The keywords of a call at a state, of those that the step takes."""
    memory = {name: getattr(states, name)[index] for name in MEMORY if name in names}
    return {**memory, **{name: value for name, value in given.items() if name in names}}


def solve_all(
    step: InterpretedStep, recorder: Recorder, solver: Solver, states: StateSet, given: Mapping[str, ArrayLike]
) -> Answers:
    """Run a step on all states, one after the other, with a solver."""
    count = len(states.q)
    answers = Answers(
        np.full(states.q.shape, np.nan),
        np.full(states.v.shape, np.nan),
        np.zeros(count),
        np.full(count, np.nan),
        np.ones(count),
        np.zeros(count),
        np.zeros(count),
    )
    recorder.solver = solver
    for i in range(count):
        recorder.solved.clear()
        try:
            result = step(states.q[i], states.v[i], **inputs_of(step.inputs, states, i, given))
        except Exception as error:  # noqa: BLE001  # whatever is raised for a state that is finite is what is looked for
            answers.status.append(Status.FAILED)
            answers.claimed.append(Status.FAILED)
            answers.raised.append(f"{type(error).__name__}: {error}")
            answers.told.append(True)
            continue
        answers.qd[i], answers.eps[i] = result.qd, result.eps
        answers.status.append(result.status)
        answers.claimed.append(recorder.solved[-1][1].claimed)
        answers.raised.append("")
        answers.told.append(result.status is Status.SOLVED or bool(result.message))
        if result.status is Status.SOLVED:
            # Measured again, from the numbers alone: the solution's own residuals are part of what is checked.
            answers.residual[i] = max(residuals(qp, s.x, s.y, s.z, s.z_box).worst_scaled for qp, s in recorder.solved)
            qp, solution = recorder.solved[0]
            answers.cost[i], answers.scale[i] = cost_of(qp, solution.x)
            answers.missed[i] = solution.residuals.primal
            answers.price[i] = sum(float(np.abs(part).sum()) for part in (solution.y, solution.z, solution.z_box))
    return answers


def cost_of(qp: QP, x: Array) -> tuple[float, float]:
    """Objective at a point, and what a difference of it is relative to."""
    quadratic, linear = 0.5 * float(x @ qp.H @ x), float(qp.g @ x)
    return quadratic + linear, max(1.0, abs(quadratic), abs(linear))


def judge_commands(
    row: Row, states: StateSet, qd: Array, eps: Array, solved: NDArray[np.bool_], *, stop: Array
) -> None:
    """Check what must hold of every command, however it came about."""
    finite = np.isfinite(qd).all(axis=1) & np.isfinite(eps).all(axis=1)
    row.check("finite", ~finite, 0.0, states)
    excess = np.max(np.maximum(qd - states.high, states.low - qd), axis=1)
    row.check("bounds", np.maximum(excess, 0.0), MARGIN * BOUND_TOLERANCE, states)
    error = np.abs(np.einsum("nij,nj->ni", states.J_fixed, qd))
    share = np.einsum("nij,nj->ni", np.abs(states.J_fixed), np.abs(qd))
    locked = np.max(error / np.maximum(share, 1.0), axis=1, initial=0.0)
    row.check("locked rows", np.where(solved, locked, 0.0), MARGIN * FIXED_TOLERANCE, states)
    told = np.abs(np.einsum("nij,nj->ni", states.J_free, qd) - states.v - eps)
    hand = np.maximum(np.abs(states.v).max(axis=1), 1.0)
    row.check("error", np.max(told, axis=1) / hand, _ERROR_TOLERANCE, states)
    off = np.max(np.abs(qd - stop), axis=1)
    row.check("safe stop", np.where(solved, 0.0, off), 1e-12, states)


def judge_answers(row: Row, states: StateSet, answers: Answers, best: Array, missed: Array) -> None:
    """Check what a solver's answers are worth against the best costs known, and count what was refused.

    By weak duality a cost can be below an exact one by the multipliers times what the rows are `missed` by: near a
    singularity, where multipliers are 1e8, an answer within a solver's tolerance of 1e-10 may look better by 1e-2. An
    answer's own missed rows are worth as much, in either direction: it may be the best for rows shifted by them.
    """
    solved = answers.solved
    row.check("raised", [bool(text) for text in answers.raised], 0.0, states)
    row.check("told", [not told for told in answers.told], 0.0, states)
    row.check("residuals", answers.residual, JUDGE_TOLERANCE, states)
    above = np.where(solved & np.isfinite(best), (answers.cost - best) / answers.scale, 0.0)
    rows_worth = answers.price * (missed + answers.missed) / answers.scale
    row.check("cost", np.maximum(above, 0.0), COST_TOLERANCE + rows_worth, states)
    row.wrong_solved = sum(
        claimed is Status.SOLVED and status is not Status.SOLVED
        for claimed, status in zip(answers.claimed, answers.status, strict=True)
    )
    count_refused(row, answers.status)


def count_refused(row: Row, statuses: list[Status]) -> None:
    """Count the ticks that ended in the safe stop, by status."""
    for status in statuses:
        if status is not Status.SOLVED:
            row.refused[status.value] = row.refused.get(status.value, 0) + 1


def judge_bad_input(row: Row, step: Any, states: StateSet, given: Mapping[str, ArrayLike]) -> None:
    """NaN or infinity in any input of the state must be an error that names it; accelerations may be infinite."""
    wrong = []
    for index in range(min(3, len(states.q))):
        good = {"q": states.q[index], "v": states.v[index], **inputs_of(step.inputs, states, index, given)}
        missed = 0
        for name in (name for name in ("q", "v", *MEMORY) if name in good):
            for bad in (np.nan,) if name == "qdd_prev" else (np.nan, np.inf, -np.inf):
                values = good[name].copy()
                values[index % values.size] = bad
                try:
                    step(**{**good, name: values})
                    missed += 1
                except InputError as error:
                    missed += not str(error).startswith(name)
        wrong.append(missed)
    row.check("nan", wrong, 0.0, states)
