"""`kinqp worst-case`: the ticks that take most, searched for or shown again."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from ..benchmarks.worst_case import CaseError, read_case, replay, search, write_case
from ..codegen import compile_step
from ..robots import load_robot
from .interrupt import interruptible

if TYPE_CHECKING:
    from ..benchmarks.worst_case import Found, WorstCase


_WIDTH = 200


def run_worst_case(
    robot: Annotated[str | None, typer.Option(help="Registered name, or a URDF file.")] = None,
    formulation: Annotated[str | None, typer.Option(help="Registered name, or module:Name.")] = None,
    mode: Annotated[str, typer.Option(help="Motion mode, e.g. fix-orientation or line:z.")] = "fix-orientation",
    ticks: Annotated[int, typer.Option(min=1, help="How many states to solve.")] = 1_000_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the states.")] = 0,
    out: Annotated[Path, typer.Option(help="File to write the case to.")] = Path("worst-case.json"),
    tip: Annotated[str | None, typer.Option(help="Frame at the tool centre point, where the URDF branches.")] = None,
    replayed: Annotated[Path | None, typer.Option("--replay", help="Show a case again instead.")] = None,
) -> None:
    """Search a compiled tick for the state with most iterations and for the slowest one."""
    # A narrower terminal, or none, would break columns; wrapped lines can still be read.
    console = Console(markup=False, soft_wrap=True, width=max(_WIDTH, Console().width))
    if replayed is not None:
        _show_again(console, replayed)
        return
    if robot is None or formulation is None:
        raise CaseError("worst-case: expected --robot and --formulation, or --replay FILE")
    console.print(f"compiling {formulation} on {robot}, {mode} ...", highlight=False)
    step = compile_step(load_robot(robot, tip=tip), formulation, mode)
    progress = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        console=Console(markup=False, stderr=True),
        transient=True,
    )
    with progress, interruptible() as interrupted:
        bar = progress.add_task("searching")

        def on_progress(done: int, total: int, most: int) -> None:
            interrupted()
            progress.update(bar, completed=done, total=total, description=f"most iterations: {most}")

        def named(found: WorstCase) -> WorstCase:
            return replace(found, robot=robot, tip=tip, formulation=formulation)

        def on_found(found: WorstCase) -> None:
            write_case(named(found), out)
            progress.update(bar, description=f"timing; most iterations: {found.most.iterations}")

        case = named(search(step, ticks=ticks, seed=seed, on_progress=on_progress, on_found=on_found))
    write_case(case, out)
    _print(console, case)
    if case.ticks < ticks:
        console.print(f"Interrupted after {case.ticks} of {ticks} ticks; what was found is kept.")
    elif case.median is None:
        console.print("Interrupted before ticks were timed; what was found is kept.")
    console.print(f"Wrote both states to {out}. Next: kinqp worst-case --replay {out}")


def _print(console: Console, case: WorstCase) -> None:
    console.print(
        f"{case.formulation} on {case.robot}, {case.mode}: {case.ticks} ticks, "
        + ", ".join(f"{count} {status}" for status, count in sorted(case.statuses.items(), key=lambda x: -x[1])),
        highlight=False,
    )
    console.print(_table(case.most, case.slowest, case.median))


def _show_again(console: Console, path: Path) -> None:
    case = read_case(path)
    again = replay(case)
    console.print(f"{path}, as it was found on {case.conditions['cpu']}:", highlight=False)
    _print(console, case)
    console.print("here and now:")
    console.print(_table(again.most, again.slowest, again.median))
    pairs = ((case.most, again.most), (case.slowest, again.slowest))
    if any((then.iterations, then.status) != (now.iterations, now.status) for then, now in pairs):
        console.print("Not the same: iterations or status differ; the versions above may say why.")
        raise typer.Exit(1)
    console.print("Iterations and status are the same.")


def _table(most: Found, slowest: Found, median: float | None) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0))
    # Nothing is known where the formulation doesn't take them.
    known = any(isfinite(x) for found in (most, slowest) for x in found.qdd_prev)
    last = ["last acc. known"] if known else []
    for head in ("", "iterations", "status", "time us", "of a typical tick", *last, "active rows"):
        table.add_column(head)
    for name, found in (("most iterations", most), ("slowest tick", slowest)):
        table.add_row(
            name,
            str(found.iterations),
            found.status,
            "-" if found.seconds is None else f"{found.seconds * 1e6:.2f}",
            "-" if found.seconds is None or median is None else f"{found.seconds / median:.2f} x",
            *([f"{sum(map(isfinite, found.qdd_prev))} of {len(found.qdd_prev)}"] if known else []),
            ", ".join(found.active) or "none",
        )
    return table
