"""The accuracy part of a cell: the solver's own closed loop, every tick judged and compared with the reference."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..control import make_step
from ..formulations import get_formulation, levels_of
from ..solvers import get_solver
from .cells import solver_of
from .loop import each_tick, fixed_inputs, remembered, row_of, to_frame
from .problems import Problems, choose_windows, ticks_of
from .scenarios import get_scenario
from .store import Part

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import polars as pl
    from numpy.typing import NDArray

    from ..control import InterpretedStep
    from ..formulations import Instance, StepResult
    from ..solvers import QP, Solution, Solver
    from .cells import Block, Cell
    from .config import SweepConfig
    from .loop import State

    Array = NDArray[np.float64]

#: What all others are compared with: our active set at its tightest. That a cell of the same method agrees with it says
#: little; that the others do, says that both are right.
REFERENCE: Final = "active-set(tolerance=1e-12)"
#: Largest scaled residual, recomputed by us, of an answer that counts as a reference [-].
REFERENCE_RESIDUAL: Final = 1e-12


class PreparedBlock:
    """A block ready to be run: its formulation lowered, its reference run, its problems recorded.

    Parameters
    ----------
    block : Block
    config : SweepConfig

    Attributes
    ----------
    problems : Problems
        The QPs of the reference's run that all cells are timed on.
    """

    def __init__(self, block: Block, config: SweepConfig) -> None:
        self.block: Final = block
        self.scenario: Final = get_scenario(block.scenario)
        self._config: Final = config
        self._reference: Final = get_solver(REFERENCE)
        formulation = get_formulation(block.formulation)
        self._steps: Final = {
            mode: make_step(self.scenario.robot, formulation, mode, self._reference) for mode in self.scenario.modes
        }
        self._inputs: Final = {mode: fixed_inputs(block, self.scenario, step) for mode, step in self._steps.items()}
        windows = choose_windows(self.scenario.ticks, config.timing_ticks, config.timing_window, config.seed)
        wanted = set(ticks_of(windows))
        self._states: Final[list[State]] = []
        self._commands: Final[list[Array | None]] = []
        qps: dict[int, tuple[QP, ...]] = {}
        for state, step, _ in self._run(self._reference, sampled=False):
            self._states.append(state)
            self._commands.append(_trusted_command(step.solved))
            if state.tick in wanted:
                qps[state.tick] = tuple(instance.qp for instance, _ in step.solved)
        self.problems: Final = Problems(windows, qps)

    def run(self, cell: Cell) -> tuple[pl.DataFrame, Part]:
        """Run a cell of the block; returns its ticks, see `to_frame`, and how it ended."""
        solver = solver_of(cell)
        sampled = cell.solver in self._config.sampled and self.scenario.states is None
        rows = [self._row(state, step, result) for state, step, result in self._run(solver, sampled=sampled)]
        loop = "sampled" if sampled else "states" if self.scenario.states is not None else "closed"
        return to_frame(rows, self.scenario), Part("done", loop=loop, ticks=len(rows), repeats=1)

    def _run(self, solver: Solver, *, sampled: bool) -> Iterator[tuple[State, InterpretedStep, StepResult]]:
        """Solve tick after tick: of the closed loop, of states, or of some of the reference's."""
        steps = {mode: step.with_solver(solver) for mode, step in self._steps.items()}
        states = self._sample() if sampled else None
        for state, result in each_tick(self.scenario, lambda state: self._solve(steps[state.mode], state), states):
            yield state, steps[state.mode], result

    def _sample(self) -> list[State]:
        count = min(self._config.samples, len(self._states))
        picked = np.unique(np.linspace(0, len(self._states) - 1, count).astype(int))
        return [self._states[index] for index in picked]

    def _solve(self, step: InterpretedStep, state: State) -> StepResult:
        return step(state.q, state.v, **self._inputs[state.mode], **remembered(step, state))

    def _row(self, state: State, step: InterpretedStep, result: StepResult) -> dict[str, Any]:
        levels = step.solved
        instance, last = levels[-1]
        setup = sum(solution.setup_time for _, solution in levels if not solution.updated)
        return row_of(self.scenario, state, result, (instance.qd_lo, instance.qd_hi)) | {
            "claimed": last.claimed.value,
            "reference_error": self._reference_error(state, levels, result.qd),
            "setup_time": setup,
            "update_time": result.setup_time - setup,
        }

    def _reference_error(self, state: State, levels: tuple[tuple[Instance, Solution], ...], qd: Array) -> float:
        """Compare a command with the reference's for the same QP, or for the same hierarchy of them."""
        step = self._steps[state.mode]
        if self._is_known(state):
            command = self._commands[state.tick]
        elif len(levels_of(step.formulation)) > 1:
            self._solve(step, state)
            command = _trusted_command(step.solved)
        else:
            instance = levels[0][0]
            command = _trusted_command(((instance, self._reference.solve(instance.qp)),))
        return float("nan") if command is None else float(np.max(np.abs(command - qd)))

    def _is_known(self, state: State) -> bool:
        """Whether the reference's own run came through this very state."""
        if state.tick >= len(self._states):
            return False
        known = self._states[state.tick]
        return all(
            np.array_equal(getattr(state, name), getattr(known, name)) for name in ("q", "qd_prev", "v", "qdd_prev")
        )


def _trusted_command(levels: Sequence[tuple[Instance, Solution]]) -> Array | None:
    """The command, where every level's answer holds as a reference."""
    if not all(solution.solved and solution.residuals.worst_scaled <= REFERENCE_RESIDUAL for _, solution in levels):
        return None
    instance, solution = levels[-1]
    command: Array = instance.K @ solution.x + instance.k
    return command
