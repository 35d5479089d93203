"""The accuracy part of a cell: the solver's own closed loop, every tick judged and compared with the reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import polars as pl

from ..control import make_step
from ..formulations import get_formulation, levels_of
from ..solvers import get_solver
from .cells import solver_of
from .problems import Problems, choose_windows, ticks_of
from .scenarios import get_scenario
from .store import Part

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from ..control import InterpretedStep
    from ..formulations import Instance, Mode, StepResult
    from ..solvers import QP, Solution, Solver
    from .cells import Block, Cell
    from .config import SweepConfig
    from .scenarios import Scenario

    Array = NDArray[np.float64]

#: What all others are compared with: our active set at its tightest. That a cell of the same method agrees with it says
#: little; that the others do, says that both are right.
REFERENCE: Final = "active-set(tolerance=1e-12)"
#: Largest scaled residual, recomputed by us, of an answer that counts as a reference [-].
REFERENCE_RESIDUAL: Final = 1e-12
# Below this length of v there is no direction to scale along [m/s, rad/s].
_STILL: Final = 1e-9


@dataclass(frozen=True)
class State:
    """What a tick is asked.

    Attributes
    ----------
    tick, phase : int
    mode : Mode
    q, qd_prev : ndarray, shape (nv,)
        [rad or m, .../s].
    v : ndarray, shape (m_free,)
        [m/s, rad/s].
    qdd_prev : ndarray, shape (nv,), or None
        None where the state has no history [rad/s^2 or m/s^2].
    """

    tick: int
    phase: int
    mode: Mode
    q: Array
    qd_prev: Array
    v: Array
    qdd_prev: Array | None = None


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
        self._inputs: Final = {mode: self._fixed_inputs(step) for mode, step in self._steps.items()}
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

    def _fixed_inputs(self, step: InterpretedStep) -> dict[str, Any]:
        unknown = [name for name in self.scenario.inputs if name not in step.inputs]
        if unknown:
            raise ValueError(
                f"{self.block}: the scenario gives {', '.join(unknown)}, the formulation takes "
                f"{', '.join(step.inputs)} only"
            )
        return {"dt": self.scenario.dt, **self.scenario.inputs}

    def _run(self, solver: Solver, *, sampled: bool) -> Iterator[tuple[State, InterpretedStep, StepResult]]:
        """Solve tick after tick: of the closed loop, of states, or of some of the reference's."""
        steps = {mode: step.with_solver(solver) for mode, step in self._steps.items()}
        if sampled or self.scenario.states is not None:
            for state in self._given_states(sampled=sampled):
                yield state, steps[state.mode], self._solve(steps[state.mode], state)
            return
        robot, dt = self.scenario.robot, self.scenario.dt
        q, qd, tick = np.array(self.scenario.q0, dtype=float), np.zeros(robot.nv), 0
        qdd = np.zeros(robot.nv)
        for index, phase in enumerate(self.scenario.phases):
            free = list(phase.mode.free_rows)
            for k in range(round(phase.duration / dt)):
                pose = robot.pose(q)
                v = (phase.mode.twist_map_at(pose) @ phase.guide.twist(k * dt, pose))[free]
                state = State(tick, index, phase.mode, q, qd, v, qdd)
                result = self._solve(steps[phase.mode], state)
                yield state, steps[phase.mode], result
                qdd = (result.qd - qd) / dt
                qd = result.qd
                q = q + dt * qd
                tick += 1

    def _given_states(self, *, sampled: bool) -> list[State]:
        if sampled:
            count = min(self._config.samples, len(self._states))
            picked = np.unique(np.linspace(0, len(self._states) - 1, count).astype(int))
            return [self._states[index] for index in picked]
        given = self.scenario.states
        assert given is not None, "a scenario without phases has states"  # noqa: S101  # checked where it is made
        return [
            State(index, 0, given.mode, q, qd, v)
            for index, (q, qd, v) in enumerate(zip(given.q, given.qd_prev, given.v, strict=True))
        ]

    def _solve(self, step: InterpretedStep, state: State) -> StepResult:
        memory = {"qd_prev": state.qd_prev, "qdd_prev": state.qdd_prev}
        remembered = {name: last for name, last in memory.items() if name in step.inputs and last is not None}
        return step(state.q, state.v, **self._inputs[state.mode], **remembered)

    def _row(self, state: State, step: InterpretedStep, result: StepResult) -> dict[str, Any]:
        levels = step.solved
        instance, last = levels[-1]
        setup = sum(solution.setup_time for _, solution in levels if not solution.updated)
        return {
            "t": state.tick * self.scenario.dt,
            "phase": state.phase,
            "q": state.q,
            "qd": result.qd,
            "qd_lo": instance.qd_lo,
            "qd_hi": instance.qd_hi,
            "v": state.v,
            "eps": result.eps,
            "status": result.status.value,
            "claimed": last.claimed.value,
            "iterations": result.iterations,
            "active": list(result.active),
            "fixed_error": result.fixed_error,
            "bound_violation": result.bound_violation,
            "sigma_min": result.sigma_min,
            "task_scale": task_scale(state.v, result.eps),
            "reference_error": self._reference_error(state, levels, result.qd),
            "setup_time": setup,
            "update_time": result.setup_time - setup,
            "solve_time": result.solve_time,
            "message": result.message,
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
        names = ("q", "qd_prev", "v", "qdd_prev")
        return all(np.array_equal(getattr(state, name), getattr(known, name)) for name in names)


def _trusted_command(levels: Sequence[tuple[Instance, Solution]]) -> Array | None:
    """The command, where every level's answer holds as a reference."""
    if not all(solution.solved and solution.residuals.worst_scaled <= REFERENCE_RESIDUAL for _, solution in levels):
        return None
    instance, solution = levels[-1]
    command: Array = instance.K @ solution.x + instance.k
    return command


def task_scale(v: Array, eps: Array) -> float:
    """Share of the velocity asked for that is achieved along it; NaN where nothing is asked for."""
    length = float(v @ v)
    return float("nan") if length < _STILL**2 else float((v + eps) @ v) / length


def to_frame(rows: list[dict[str, Any]], scenario: Scenario) -> pl.DataFrame:
    """Make one row per tick.

    Columns: `t` [s]; `phase`; `q`, `qd`, `qd_lo`, `qd_hi`, arrays of nv [rad or m, .../s]; `v`, `eps`, lists of m_free
    [m/s, rad/s]; `status`, ours, and `claimed`, the solver's; `iterations`; `active`, names of rows; `fixed_error`
    [m/s, rad/s]; `bound_violation` [rad/s or m/s]; `sigma_min`; `task_scale` [-]; `reference_error` [rad/s or m/s], NaN
    where there is no reference; `setup_time`, `update_time` (one of them 0, of hierarchies perhaps neither),
    `solve_time` [s]; `message`.
    """
    nv = scenario.robot.nv
    joint = pl.Array(pl.Float64, nv)
    columns: dict[str, pl.Series] = {}
    for name, first in rows[0].items():
        values = [row[name] for row in rows]
        if name in ("q", "qd", "qd_lo", "qd_hi"):
            columns[name] = pl.Series(np.array(values), dtype=joint)
        elif name in ("v", "eps"):
            columns[name] = pl.Series([value.tolist() for value in values], dtype=pl.List(pl.Float64))
        elif name == "active":
            columns[name] = pl.Series(values, dtype=pl.List(pl.String))
        elif isinstance(first, str):
            columns[name] = pl.Series(values, dtype=pl.String)
        elif name in ("phase", "iterations"):
            columns[name] = pl.Series(values, dtype=pl.Int64)
        else:
            columns[name] = pl.Series(values, dtype=pl.Float64)
    return pl.DataFrame(columns)
