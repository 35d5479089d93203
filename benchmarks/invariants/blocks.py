"""A block: a formulation on a robot in a mode, all solvers on the same states."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from time import process_time
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...codegen import CurvatureError, compile_step
from ...formulations import DeclarationError, Hierarchy, Mode, get_formulation
from ...formulations.to_cvxpy import CvxpyProblem
from ...robots import RobotError
from ...solvers import get_solver
from .answers import judge_answers, judge_bad_input, judge_commands, recorded_step, solve_all
from .compiled import judge_compiled, judge_parity
from .declared import judge_declared
from .rounding import judge_rounding
from .states import States, StateSet, arm
from .tally import Row
from .worth import judge_worth

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from .answers import Answers

    Array = NDArray[np.float64]

COMPILED: Final = "active-set in C"
REFERENCE: Final = "active-set"
CVXPY: Final = "cvxpy"
#: Of the states of `cvxpy`, the part that is put to the declared problem too, which compiles anew for every block.
DECLARED_SHARE: Final = 5
# What constraints ask for, or are given to say something: a ball and a bar within reach, a contact close to its bound.
GIVEN: Final[Mapping[str, Any]] = {
    "obstacles_sphere1_start": [0.3, 0.1, 0.5],
    "obstacles_bar1_start": [0.4, -0.3, 0.0],
    "obstacles_bar1_end": [0.4, -0.3, 0.8],
    "contact_force_normal": [0.0, 0.6, -0.8],
    "contact_force_now": [19.9],
}


@dataclass(frozen=True)
class Block:
    """What is to be run.

    Attributes
    ----------
    formulation, robot, mode : str
        As for `get_formulation`, `arm` and `Mode.parse`.
    counts : tuple of (str, int)
        How many states for each solver; `COMPILED` is the compiled step, `CVXPY` Clarabel through cvxpy and the
        declared problem in cvxpy, all others are as for `get_solver`.
    seed : int
    """

    formulation: str
    robot: str
    mode: str
    counts: tuple[tuple[str, int], ...]
    seed: int = 0


@functools.lru_cache(maxsize=2)
def states_at(robot: str, mode: str, seed: int, count: int) -> StateSet:
    """States of a robot in a mode; the formulations of a robot in a mode share them."""
    return States(arm(robot), Mode.parse(mode), seed).take(count)


def run_block(block: Block) -> list[Row]:
    """Check all solvers of a block; one row for each."""
    counts = dict(block.counts)
    formulation, mode = get_formulation(block.formulation), Mode.parse(block.mode)
    rows = {
        name: Row(formulation=block.formulation, robot=block.robot, mode=block.mode, solver=name) for name in counts
    }
    start = process_time()
    try:
        step, recorder = recorded_step(arm(block.robot), formulation, mode)
    except (RobotError, DeclarationError) as error:
        for row in rows.values():
            row.skipped = str(error)
        return list(rows.values())
    states = states_at(block.robot, block.mode, block.seed, max(counts.values()))
    stop = states.braking if formulation.safe_stop == "braking" else np.zeros_like(states.q)

    interpreted: dict[str, Answers] = {}
    # The reference first: the others are compared with it.
    for name in sorted(counts, key=lambda name: name != REFERENCE):
        if name != COMPILED:
            solver = get_solver("cvxpy:CLARABEL" if name == CVXPY else name)
            interpreted[name] = solve_all(step, recorder, solver, states.first(counts[name]), GIVEN)
            rows[name].cpu, start = process_time() - start, process_time()
    best, missed = _best(interpreted, len(states.q))
    for name, answers in interpreted.items():
        row, row.states = rows[name], counts[name]
        mine = states.first(row.states)
        judge_commands(row, mine, answers.qd, answers.eps, answers.solved, stop=stop[: row.states])
        judge_answers(row, mine, answers, best[: row.states], missed[: row.states])
        recorder.solver = get_solver(REFERENCE)
        judge_bad_input(row, step, mine, GIVEN)
    start = process_time()
    if CVXPY in counts and not isinstance(formulation, Hierarchy):
        some = states.first(max(1, counts[CVXPY] // DECLARED_SHARE))
        made = formulation.to_cvxpy(arm(block.robot), mode)
        if not isinstance(made, CvxpyProblem):
            raise TypeError(f"{block.formulation}: expected one problem in cvxpy, got {type(made).__name__}")
        judge_declared(rows[CVXPY], made, step, some, GIVEN, _enough(interpreted.get(REFERENCE), len(some.q)))
        rows[CVXPY].cpu += process_time() - start
    if COMPILED in counts:
        row, start = rows[COMPILED], process_time()
        row.states = counts[COMPILED]
        try:
            made_c = compile_step(arm(block.robot), formulation, mode)
        except (DeclarationError, CurvatureError) as error:
            row.skipped, row.states = str(error), 0
            return list(rows.values())
        mine = states.first(row.states)
        compiled = judge_compiled(row, made_c, mine, GIVEN, stop[: row.states])
        if REFERENCE in interpreted:
            recorder.solver = get_solver(REFERENCE)
            apart = judge_parity(row, (step, made_c), mine, GIVEN, interpreted[REFERENCE], compiled)
            left = judge_worth(row, step, mine, GIVEN, compiled, apart)
            judge_rounding(row, step, mine, GIVEN, compiled[0], left)
        row.cpu = process_time() - start
    return list(rows.values())


def _best(interpreted: Mapping[str, Answers], count: int) -> tuple[Array, Array]:
    """Lowest cost that any solver reached at each state, NaN where none solved it; and by how much its rows are off."""
    best, missed = np.full(count, np.nan), np.zeros(count)
    for answers in interpreted.values():
        first = slice(len(answers.cost))
        lower = answers.solved & ~(answers.cost >= best[first])
        best[first] = np.where(lower, answers.cost, best[first])
        missed[first] = np.where(lower, answers.missed, missed[first])
    return best, missed


def _enough(answers: Answers | None, count: int) -> Answers | None:
    return answers if answers is not None and len(answers.qd) >= count else None
