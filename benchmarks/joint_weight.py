"""What the joint weight of `joint-space` costs and buys: ``python -m kinqp.benchmarks.joint_weight``.

A small weight leaves the hand its speed, and makes the QP flat; a solver that stops on a duality gap then stops far
from the minimiser. The default weight is chosen from this table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from rich.console import Console
from rich.progress import track

from ..control import InterpretedStep, make_step, simulate
from ..formulations import JointSpace
from ..solvers import Status, get_solver
from .conditions import conditions
from .scenarios import get_scenario

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

WEIGHTS: Final = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
# PIQP's and Clarabel's own defaults, and this library's.
SOLVERS: Final = ("piqp(tolerance=1e-8)", "piqp", "clarabel(tolerance=1e-8)", "clarabel")
# The thesis's method solves each KKT system directly: with its tolerances taken away its answer, where its residuals
# hold, is exact but for rounding.
REFERENCE: Final = "thesis-active-set(tolerance=1e-13, min_slope=1e-12)"


@dataclass(frozen=True)
class WeightRow:
    """One weight.

    Attributes
    ----------
    weight : float
        joint_weight.
    states : int
        States with an exact reference.
    lost_speed : float
        Median share of the hand's speed that the weight takes off where no limit is active.
    errors : dict of str to float
        Largest difference of a command from the exact one [rad/s], by solver.
    refused : dict of str to int
        States whose answer did not pass our judgement, by solver.
    """

    weight: float
    states: int
    lost_speed: float
    errors: dict[str, float]
    refused: dict[str, int]


def joint_weight_study(every: int = 8, weights: Sequence[float] = WEIGHTS) -> list[WeightRow]:
    """Solve the semicircle's QPs with each weight by each solver and compare with exact answers.

    Parameters
    ----------
    every : int
        Take every so many-th tick.
    weights : sequence of float
        Joint weights.
    """
    scenario = get_scenario("semicircle")
    step = make_step(scenario.robot, JointSpace(), scenario.mode, REFERENCE)
    run = simulate(step, scenario.guide, scenario.q0, scenario.duration, dt=scenario.dt)
    moving = np.flatnonzero(np.linalg.norm(run.v, axis=1) > 1e-3)[::every]
    return [_study(step, run.q[moving], run.v[moving], weight) for weight in track(weights, "weights", transient=True)]


def _study(step: InterpretedStep, Q: Array, V: Array, weight: float) -> WeightRow:
    solvers = {name: get_solver(name) for name in SOLVERS}
    errors, refused = dict.fromkeys(SOLVERS, 0.0), dict.fromkeys(SOLVERS, 0)
    lost: list[float] = []
    states = 0
    for q, v in zip(Q, V, strict=True):
        instance = step.evaluate(q, v, joint_weight=weight)
        exact = step.solver.solve(instance.qp)
        if exact.status is not Status.SOLVED:
            continue
        states += 1
        qd = instance.K @ exact.x + instance.k
        if not exact.z_box.any():
            eps = instance.J_free @ qd - v
            lost.append(float(np.linalg.norm(eps) / np.linalg.norm(v)))
        for name, solver in solvers.items():
            solution = solver.solve(instance.qp)
            refused[name] += solution.status is not Status.SOLVED
            error = float(np.max(np.abs(instance.K @ solution.x + instance.k - qd)))
            errors[name] = max(errors[name], error)
    return WeightRow(weight, states, float(np.median(lost)), errors, refused)


def to_markdown(rows: Sequence[WeightRow]) -> str:
    """Write the study as a Markdown table."""
    head = ["joint weight", "lost speed", *(f"{name}: largest error [rad/s] (refused)" for name in SOLVERS)]
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for row in rows:
        cells = [f"{row.errors[name]:.1e} ({row.refused[name]})" for name in SOLVERS]
        lines.append(f"| {row.weight:.0e} | {100 * row.lost_speed:.2g} % | " + " | ".join(cells) + " |")
    lines += ["", f"{rows[0].states} states a row. " + "; ".join(f"{k} {v}" for k, v in conditions().items()) + "."]
    return "\n".join(lines)


if __name__ == "__main__":
    Console(soft_wrap=True).print(to_markdown(joint_weight_study()), markup=False, highlight=False)
