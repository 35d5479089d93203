"""``python -m kinqp.benchmarks.invariants``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from ...formulations import available_formulations
from ...robots import RobotError
from ...solvers.plugins import PluginError
from ..conditions import conditions
from .blocks import COMPILED, CVXPY, REFERENCE, Block
from .run import InvariantsError, run
from .table import to_markdown

ROBOTS: Final = ("lbr_med14", "ur5e", "panda")
# One of each, with arguments along no axis.
MODES: Final = ("free", "position", "fix-orientation", "fix-position", "line:z", "plane:1,-2,0.5", "rcm:-0.12")
CONSTRAINED: Final = (
    "joint-space + self-collision",
    "cartesian-error + self-collision + twist-limits(frame=tool)",
    "joint-space + obstacles(spheres=1, bars=1) + singularity + contact-force",
    "joint-space + elbow-range + elbow-bend",
    "cartesian-error + elbow-hold(correct=1, angle=1) + remote-centre(pivot=0.5 0 0.3)",
)
CONSTRAINED_MODES: Final = ("free", "fix-orientation")
COUNTS: Final = {COMPILED: 10_000, REFERENCE: 10_000, "clarabel": 10_000, "piqp": 10_000, CVXPY: 200}


def main(
    formulation: Annotated[
        list[str] | None, typer.Option(help="Again for each; without: all, and some with constraints.")
    ] = None,
    robot: Annotated[list[str], typer.Option(help="Again for each.")] = list(ROBOTS),  # noqa: B006  # typer copies it
    mode: Annotated[list[str] | None, typer.Option(help="Again for each; without: one of each of the seven.")] = None,
    solver: Annotated[
        list[str] | None,
        typer.Option(help=f"NAME or NAME=STATES, again for each. '{COMPILED}' is the compiled step, with its batch."),
    ] = None,
    states: Annotated[int | None, typer.Option(help="States a cell, where a solver has no number of its own.")] = None,
    constrained_share: Annotated[int, typer.Option(help="Divides the states of formulations with constraints.")] = 10,
    seed: Annotated[int, typer.Option(help="States are made of it and their number.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes.")] = 1,
    out: Annotated[Path, typer.Option(help="Results folder.")] = Path("results/invariants"),
    resume: Annotated[bool, typer.Option(help="Keep the blocks that the folder holds.")] = False,
) -> None:
    """Check what must hold of every command: formulations x solvers x arms x modes on random and adversarial states."""
    console = Console(soft_wrap=True)
    try:
        counts = _counts(solver, states)
        blocks = make_blocks(formulation, robot, mode, counts, constrained_share, seed)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
        with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), transient=True) as progress:
            task = progress.add_task("blocks", total=len(blocks))
            rows = run(
                blocks,
                out,
                workers=workers,
                resume=resume,
                on_progress=lambda done, total, name: progress.update(
                    task, completed=done, total=total, description=name
                ),
            )
    except (InvariantsError, PluginError, RobotError, ValueError) as error:
        Console(stderr=True, soft_wrap=True).print(f"error: {error}", markup=False, highlight=False)
        raise typer.Exit(1) from error
    text = to_markdown(rows) + "\n" + "; ".join(f"{k} {v}" for k, v in conditions().items()) + ".\n"
    (out / "table.md").write_text(text, encoding="utf-8")
    console.print(text, markup=False, highlight=False)
    console.print(f"{out / 'table.md'} holds this table, {out / 'blocks'} the states.", markup=False, highlight=False)


def _counts(solvers: list[str] | None, states: int | None) -> dict[str, int]:
    counts = {}
    for text in solvers or list(COUNTS):
        name, equals, number = text.rpartition("=")
        if not equals or not number.isdigit():  # an option in brackets has a sign of equality too
            name, number = text, str(states or COUNTS.get(text, COUNTS[CVXPY]))
        if int(number) < 1:
            raise ValueError(f"solver {name}: expected a number of states, got {number}")
        counts[name] = int(number)
    return counts


def make_blocks(
    formulations: list[str] | None,
    robots: list[str],
    modes: list[str] | None,
    counts: dict[str, int],
    constrained_share: int,
    seed: int,
) -> list[Block]:
    """Blocks in the order in which they share their states: mode, robot, formulation."""
    chosen = formulations or [*available_formulations(), *CONSTRAINED]
    blocks = []
    for mode in modes or MODES:
        for robot in robots:
            for name in chosen:
                constrained = "+" in name
                if constrained and not modes and mode not in CONSTRAINED_MODES:
                    continue
                share = constrained_share if constrained else 1
                fewer = tuple((solver, max(1, count // share)) for solver, count in counts.items())
                blocks.append(Block(name, robot, mode, fewer, seed))
    return blocks


if __name__ == "__main__":
    typer.run(main)
