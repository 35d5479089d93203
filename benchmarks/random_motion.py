"""Robust formulations on random paths: ``python -m kinqp.benchmarks.random_motion [--seed N] [ROBOT ...]``.

Each closed loop runs the compiled step at 1 kHz; the table is one of docs/singularities.md. ROBOT is an arm as
registered, or `panda` with the optional package example-robot-data; LBR Med 14 and UR5e unless told otherwise.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

import numpy as np
from rich.console import Console
from rich.progress import track

from ..codegen import compile_step
from .conditions import conditions
from .invariants import arm
from .least_acceleration import OVER
from .scenarios.disturbances import DISTURBANCES, Disturbance
from .scenarios.random_paths import RANDOM_MODES, random_paths
from .scenarios.singular import ROBOT
from .singular import VARIANTS, singular_run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..robots import Robot
    from .singular import SingularRow

ROBUST: Final = ("joint-space-robust", "cartesian-error-robust")
#: Both speeds, and each thing that a real arm adds at the lower one.
CONDITIONS: Final = (Disturbance(), *DISTURBANCES)
HEAD: Final = (
    "robot", "with", "formulation", "calm", "chatter [1/s]", "most", "peak qd/max", "peak qdd/max", "over",
    "unforced", "error [m/s]", "locked rows", "really", "failed",
)  # fmt: skip


def random_sweep(
    robots: Sequence[Robot],
    formulations: Sequence[str] = ROBUST,
    disturbances: Sequence[Disturbance] = CONDITIONS,
    *,
    count: int = 3,
    first_seed: int = 0,
) -> str:
    """Run formulations on random paths of every mode; a Markdown table of what came out.

    Parameters
    ----------
    robots : sequence of Robot
    formulations : sequence of str
        As in `singular_sweep`.
    disturbances : sequence of Disturbance
    count : int
        Paths for each robot, mode and disturbance.
    first_seed : int
        Of the first mode's paths; the next mode has the next one.
    """
    lines = ["| " + " | ".join(HEAD) + " |", "|" + " --- |" * len(HEAD)]
    cells = [(robot, name) for robot in robots for name in formulations]
    for robot, name in track(cells, "random paths", transient=True):
        rows: dict[Disturbance, list[SingularRow]] = {disturbance: [] for disturbance in disturbances}
        for seed, mode in enumerate(RANDOM_MODES, first_seed):
            step = compile_step(robot, VARIANTS.get(name, name), mode)
            for path in random_paths(robot, mode, count, seed):
                for disturbance, found in rows.items():
                    found.append(singular_run(step, path, disturbance, every=100))
        lines += [_line(robot, name, disturbance, found) for disturbance, found in rows.items()]
    return "\n".join(lines)


def _line(robot: Robot, name: str, disturbance: Disturbance, rows: Sequence[SingularRow]) -> str:
    chatter, peak = [row.chatter for row in rows], [row.peak_acceleration for row in rows]
    calm = f"{chatter.count(0.0)} of {len(rows)}"
    return (
        f"| {robot.name} | {disturbance.name} | {name} | {calm} | {np.mean(chatter):.2f} | {max(chatter):.1f} | "
        f"{max(row.peak_speed for row in rows):.2f} | {max(peak):.2f} | "
        f"{sum(one > 1.0 + OVER for one in peak)} | {max(row.unforced for row in rows):.2f} | "
        f"{np.mean([row.task_error for row in rows]):.4f} | {max(row.fixed_error for row in rows):.0e} | "
        f"{max(row.true_error for row in rows):.0e} | {sum(row.failed for row in rows)} |"
    )


def main() -> None:
    """Print the table and the conditions."""
    parser = argparse.ArgumentParser(prog="python -m kinqp.benchmarks.random_motion", description=__doc__)
    parser.add_argument("robots", nargs="*", metavar="ROBOT")
    parser.add_argument("--seed", type=int, default=0, help="of the first mode's paths; the next mode has the next one")
    given = parser.parse_args()
    console = Console(soft_wrap=True)
    table = random_sweep([arm(name) for name in given.robots or (ROBOT, "ur5e")], first_seed=given.seed)
    console.print(f"{table}\n", markup=False, highlight=False)
    console.print("; ".join(f"{k} {v}" for k, v in conditions().items()) + ".", markup=False, highlight=False)


if __name__ == "__main__":
    main()
