"""`kinqp report` and `kinqp compare`: no logic of their own, only words for people."""

from __future__ import annotations

import json
import sys
from pathlib import Path  # noqa: TC003  # Typer reads annotations at run time
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from ..benchmarks import Store
from ..benchmarks.compare import TOLERANCE, compare

if TYPE_CHECKING:
    from ..benchmarks.compare import Comparison
    from ..benchmarks.compare_cell import Finding

_COLOURS = {"worse": "red", "changed": "yellow", "better": "green"}
# Without --all. What is worse comes first, and none of it is left out.
_SHOWN = 30
_WIDTH = 150


def run_report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Results folder of a sweep.")],
    figures: Annotated[bool, typer.Option(help="Write the paper's figures, too.")] = True,
    scenario: Annotated[list[str] | None, typer.Option(help="In the figures; may be repeated. All without.")] = None,
    formulation: Annotated[list[str] | None, typer.Option(help="In the figures; may be repeated.")] = None,
    solver: Annotated[list[str] | None, typer.Option(help="In the figures; may be repeated.")] = None,
    start: Annotated[str, typer.Option(help="In the figures: how solvers start.")] = "cold",
) -> None:
    """Write a sweep's report: one HTML page that works offline, and PNG and SVG figures."""
    # Drawing takes a second to import, and only this command draws.
    from ..benchmarks.report import Selection, write_report

    errors = Console(markup=False, stderr=True)
    progress = Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        console=errors, transient=True, disable=not errors.is_terminal,
    )  # fmt: skip
    with progress:
        bar = progress.add_task("reading")

        def on_progress(what: str, done: int, total: int) -> None:
            progress.update(bar, description=what, completed=done, total=total)

        chosen = Selection(tuple(scenario or ()), tuple(formulation or ()), tuple(solver or ()), start)
        report = write_report(Store(folder), figures=figures, selection=chosen, on_progress=on_progress)
    console = Console(markup=False, soft_wrap=True, highlight=False)
    console.print(
        f"Wrote {report.page} ({report.cells} cells, {report.page.stat().st_size / 1e6:.1f} MB)", markup=False
    )
    if report.figures:
        console.print(f"and {len(report.figures)} figures to {report.figures[0].parent}.")
    console.print(f"Next: open {report.page} in a browser; it needs no network.")


def run_compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="Results folder before.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="Results folder after.")],
    tolerance: Annotated[float, typer.Option(help="Share that times must have changed by, noise aside.")] = TOLERANCE,
    confidence: Annotated[float, typer.Option(help="Of the intervals of times.")] = 0.99,
    times: Annotated[bool, typer.Option(help="Compare times.")] = True,
    allow_other_machine: Annotated[
        bool, typer.Option("--allow-other-machine", help="Compare times although CPU or system differ.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")] = False,
    show_all: Annotated[bool, typer.Option("--all", help="Show what changed and what is better in full.")] = False,
) -> None:
    """Say what got better or worse from sweep A to sweep B; exit 1 on a regression, 2 on bad input."""
    found = compare(
        Store(a), Store(b), allow_other_machine=allow_other_machine, tolerance=tolerance, confidence=confidence,
        times=times,
    )  # fmt: skip
    if as_json:
        json.dump(found.to_json(), sys.stdout, indent=1)
        sys.stdout.write("\n")
    else:
        _print(found, show_all=show_all)
    if found.regressed:
        raise typer.Exit(1)


def _print(found: Comparison, *, show_all: bool) -> None:
    console = Console(markup=False, width=max(_WIDTH, Console().width), highlight=False)
    for warning in found.warnings:
        console.print(f"note: {warning}", style="yellow")
    for what, cells in (("A", found.only_a), ("B", found.only_b)):
        if cells:
            shown = cells if show_all else cells[:_SHOWN]
            more = f", and {len(cells) - len(shown)} more (--all)" if len(shown) < len(cells) else ""
            console.print(f"only in {what} ({len(cells)}): {', '.join(shown)}{more}")
    for verdict in ("worse", "changed", "better"):
        some = found.of(verdict)
        if some:
            console.print(_table(verdict, some, show_all=show_all or verdict == "worse"))
    counts = ", ".join(f"{len(found.of(verdict))} {verdict}" for verdict in ("worse", "changed", "better"))
    timed = f"{found.timed} with times" if found.times_compared else "times not compared"
    console.print(f"{found.compared} cells compared, {timed}: {counts}.")
    if found.regressed:
        console.print("Regressed. Next: kinqp report on both folders, and look at the cells above.", style="bold red")
    else:
        console.print("No regression.", style="bold green")


def _table(verdict: str, findings: tuple[Finding, ...], *, show_all: bool) -> Table:
    shown = findings if show_all else findings[:_SHOWN]
    left = f", first {len(shown)} shown (--all)" if len(shown) < len(findings) else ""
    table = Table(
        title=f"{verdict} ({len(findings)}{left})", title_style=f"bold {_COLOURS[verdict]}", title_justify="left",
        box=box.SIMPLE_HEAD, pad_edge=False,
    )  # fmt: skip
    for name, justify in (("cell", "left"), ("measure", "left"), ("before", "right"), ("after", "right"), ("", "left")):
        table.add_column(name, justify="right" if justify == "right" else "left", overflow="fold")
    for one in shown:
        table.add_row(one.cell, one.measure, _number(one.a), _number(one.b), one.text)
    return table


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
