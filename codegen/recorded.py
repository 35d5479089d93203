"""Recorded ticks of a step, which an export brings along so that it can check itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from ..formulations import ABOVE, DEFAULT_DT, Evaluator, levels_of, lower
from ..solvers import get_solver
from .emit import number
from .examples import ExportError, example_inputs, example_lines, stack_examples

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..formulations import Formulation, Mode
    from ..robots import Robot
    from ..solvers import Solver
    from .model import StepCode

    Array = NDArray[np.float64]

TICKS_PER_MODE: Final = 200
# The hand moves this much per tick [m/s, rad/s]; fast, so that a short record meets limits.
_HAND_SPEED: Final = 0.4


@dataclass(frozen=True)
class Recorded:
    """Ticks and the answers to them: mode (N,), q, qd (N, nv), v (N, m_free); start (N,), 1 where the arm was at rest.

    Elsewhere the last command is that of the tick before, and the last acceleration what led to it. `examples` has the
    values of parameters without a default, each (modes, size).
    """

    mode: NDArray[np.int64]
    start: NDArray[np.int64]
    q: Array
    v: Array
    qd: Array
    examples: dict[str, Array]


def record(robot: Robot, formulation: Formulation, modes: Sequence[Mode]) -> Recorded:
    """Run every mode in closed loop through the interpreted path, from where every other joint is close to its limit.

    Ticks whose answer the solver itself doesn't vouch for are left out; after one the arm is at rest again.
    """
    low = np.where(np.isfinite(robot.q_min), robot.q_min, -np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, np.pi)
    rng = np.random.default_rng(0)
    columns: list[tuple[int, bool, Array, Array, Array]] = []
    examples: list[dict[str, Array]] = []
    for index, mode in enumerate(modes):
        levels = [Evaluator(lower(level, robot, mode)) for level in levels_of(formulation)]
        solver = get_solver("active-set", tolerance=1e-10)
        q = low + (0.25 + 0.5 * rng.random(robot.nv)) * (high - low)
        q[1::2] = high[1::2] - 1e-3  # several at once, so that the solver has something to do
        given = example_inputs([each for level in levels for each in level.inputs], q)
        examples.append(given)
        start, qd, qdd = True, np.zeros(robot.nv), np.zeros(robot.nv)
        amplitude = _HAND_SPEED * rng.uniform(0.5, 1.0, mode.m_free)
        phase = rng.uniform(0.0, 2.0 * np.pi, mode.m_free)
        for tick in range(TICKS_PER_MODE):
            v = amplitude * np.sin(phase + 2.0 * np.pi * tick / TICKS_PER_MODE)
            command = _command(levels, solver, given | {"q": q, "v": v, "qd_prev": qd, "qdd_prev": qdd})
            if command is None:
                start, qd, qdd = True, np.zeros(robot.nv), np.zeros(robot.nv)
                q = q + 1e-3 * rng.normal(size=robot.nv)
                continue
            columns.append((index, start, q, v, command))
            start, qd, qdd = False, command, (command - qd) / DEFAULT_DT
            q = q + DEFAULT_DT * qd
    if not columns:
        raise ExportError(f"{formulation.name} on {robot.name}: expected ticks that can be solved, got none")
    widest = max(mode.m_free for mode in modes)
    return Recorded(
        np.array([index for index, *_ in columns]),
        np.array([int(start) for _, start, *_ in columns]),
        np.array([q for _, _, q, _, _ in columns]),
        np.array([np.pad(v, (0, widest - len(v))) for *_, v, _ in columns]),
        np.array([qd for *_, qd in columns]),
        stack_examples(examples),
    )


def _command(levels: Sequence[Evaluator], solver: Solver, given: dict[str, Array]) -> Array | None:
    """Command at a state; none where a level is not solved."""
    for evaluate in levels:
        names = {each.name for each in evaluate.inputs}
        instance = evaluate(**{name: value for name, value in given.items() if name in names})
        solution = solver.solve(instance.qp)
        if not solution.solved:
            return None
        given = given | {ABOVE: instance.K @ solution.x + instance.k}
    return given[ABOVE]


def recorded_header(recorded: Recorded, code: StepCode, *, remembers: bool) -> str:
    """Write recorded ticks as a C header of constant tables; `remembers`: with where the memory of main.c starts."""
    lines = [
        "/* Recorded ticks and the answers to them: see main.c. */",
        f"#ifndef {code.prefix.upper()}_RECORDED_H",
        f"#define {code.prefix.upper()}_RECORDED_H",
        "",
        f"enum {{ recorded_ticks = {len(recorded.mode)} }};",
        "",
        f"static const int recorded_mode[recorded_ticks] = {{{', '.join(map(str, recorded.mode))}}};",
    ]
    if remembers:
        lines += ["", "/* 1: the arm is at rest, and what was sent before is of no account */"]
        lines += [f"static const int recorded_start[recorded_ticks] = {{{', '.join(map(str, recorded.start))}}};"]
    units = {"q": "rad or m", "v": "m/s, rad/s", "qd": "rad/s or m/s"}
    for name, unit in units.items():
        table: Array = getattr(recorded, name)
        lines += ["", f"/* [{unit}] */", f"static const double recorded_{name}[recorded_ticks][{table.shape[1]}] = {{"]
        lines += [f"    {{{', '.join(number(float(x)) for x in row)}}}," for row in table]
        lines.append("};")
    lines += example_lines(recorded.examples)
    return "\n".join([*lines, "", "#endif", ""])
