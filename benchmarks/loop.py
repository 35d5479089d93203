"""The closed loop that cells are run in, whoever resolves the motion, and its ticks as a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import polars as pl

from ..control.last_command import LastCommand
from ..solvers import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from ..baselines import BaselineStep
    from ..control import InterpretedStep
    from ..formulations import Mode, StepResult
    from .cells import Block
    from .scenarios import Scenario

    Array = NDArray[np.float64]

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


def each_tick(
    scenario: Scenario, act: Callable[[State], StepResult], states: Sequence[State] | None = None
) -> Iterator[tuple[State, StepResult]]:
    """Run tick after tick: the closed loop, or the scenario's states, or `states` where these are given."""
    if states is None and scenario.states is not None:
        given = scenario.states
        states = [
            State(index, 0, given.mode, q, qd, v)
            for index, (q, qd, v) in enumerate(zip(given.q, given.qd_prev, given.v, strict=True))
        ]
    if states is not None:
        for state in states:
            yield state, act(state)
        return
    robot, dt = scenario.robot, scenario.dt
    q, last, tick = np.array(scenario.q0, dtype=float), LastCommand(robot.nv, dt), 0
    for index, phase in enumerate(scenario.phases):
        free = list(phase.mode.free_rows)
        for k in range(round(phase.duration / dt)):
            pose = robot.pose(q)
            v = (phase.mode.twist_map_at(pose) @ phase.guide.twist(k * dt, pose))[free]
            state = State(tick, index, phase.mode, q, last.qd, v, last.qdd)
            result = act(state)
            yield state, result
            last.sent(result.qd, stop=result.status is not Status.SOLVED)
            q = q + dt * result.qd
            tick += 1


def fixed_inputs(block: Block, scenario: Scenario, step: InterpretedStep | BaselineStep) -> dict[str, Any]:
    """Run-time inputs that are the same at all ticks of a run.

    Raises
    ------
    ValueError
        When the scenario gives one that the step does not take.
    """
    unknown = [name for name in scenario.inputs if name not in step.inputs]
    if unknown:
        kind = "baseline" if block.baseline else "formulation"
        raise ValueError(
            f"{block}: the scenario gives {', '.join(unknown)}, the {kind} takes {', '.join(step.inputs)} only"
        )
    return {"dt": scenario.dt, **scenario.inputs}


def remembered(step: InterpretedStep | BaselineStep, state: State) -> dict[str, Array]:
    """Run-time inputs that a tick is given of the one before, where the step takes them."""
    memory = {"qd_prev": state.qd_prev, "qdd_prev": state.qdd_prev}
    return {name: last for name, last in memory.items() if name in step.inputs and last is not None}


def row_of(scenario: Scenario, state: State, result: StepResult, bounds: tuple[Array, Array]) -> dict[str, Any]:
    """Gather what every tick has, whoever resolved it; `bounds` are the joint velocities', shapes (nv,) [rad/s or m/s].

    What only a solver has is left empty: no reference, no set-up, and claimed is that it is solved.
    """
    return {
        "t": state.tick * scenario.dt,
        "phase": state.phase,
        "q": state.q,
        "qd": result.qd,
        "qd_lo": bounds[0],
        "qd_hi": bounds[1],
        "v": state.v,
        "eps": result.eps,
        "status": result.status.value,
        "claimed": "solved",
        "iterations": result.iterations,
        "active": list(result.active),
        "fixed_error": result.fixed_error,
        "bound_violation": result.bound_violation,
        "sigma_min": result.sigma_min,
        "task_scale": task_scale(state.v, result.eps),
        "reference_error": float("nan"),
        "setup_time": 0.0,
        "update_time": 0.0,
        "solve_time": result.solve_time,
        "message": result.message,
    }


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
