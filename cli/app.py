"""The `kinqp` command: no logic of its own, only words for people."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from ..baselines import available_baselines, get_baseline
from ..benchmarks import (
    TABLE_WIDTH,
    ClusterError,
    CompareError,
    ConfigError,
    ReportError,
    Store,
    StoreError,
    available_scenarios,
    get_scenario,
    load_config,
    sweep,
    sweep_table,
)
from ..benchmarks.certify import SliceError
from ..benchmarks.study import StudyError
from ..benchmarks.worst_case import CaseError
from ..codegen import CurvatureError, ExportError, export_c
from ..control import export_guiding
from ..formulations import MODE_NAMES, DeclarationError, ModeError, PlotError, available_formulations, get_formulation
from ..robots import RobotError, available_robots, load_robot
from ..robots.text import one_line
from ..solvers import OptionError, UnknownOptionError, available_solvers
from ..solvers.native import CompilerError
from ..solvers.plugins import PluginError
from .certify import run_certify
from .davinci import run_davinci
from .interrupt import interruptible
from .report import run_compare, run_report
from .study import run_study
from .worst_case import run_worst_case

if TYPE_CHECKING:
    from collections.abc import Callable

# What a user can get wrong. Anything else is a mistake of ours and deserves its traceback.
USER_ERRORS = (
    CaseError,
    ClusterError,
    CompareError,
    CompilerError,
    ConfigError,
    CurvatureError,
    DeclarationError,
    ExportError,
    ModeError,
    OptionError,
    PlotError,
    PluginError,
    ReportError,
    RobotError,
    SliceError,
    StoreError,
    StudyError,
    UnknownOptionError,
    OSError,
)

app = typer.Typer(
    name="kinqp",
    help="Motion of hand-guided robot arms as quadratic programs: declare once, solve with anything, benchmark it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


app.command("report")(run_report)
app.command("compare")(run_compare)
app.command("davinci")(run_davinci)
app.command("study")(run_study)
app.command("worst-case")(run_worst_case)
app.command("certify")(run_certify)


@app.command("list")
def list_all() -> None:
    """List robots, modes, formulations, baselines, solvers and scenarios."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(style="bold", no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column()
    described = {name: _described(name) for name in available_formulations()}
    rows: dict[str, dict[str, str]] = {
        "robots": dict.fromkeys(available_robots(), ""),
        "modes": dict.fromkeys(MODE_NAMES, ""),
        "formulations": described,
        "baselines": {name: _described(name, get_baseline) for name in available_baselines()},
        "solvers": dict.fromkeys(available_solvers(), ""),
        "scenarios": {name: get_scenario(name).description for name in available_scenarios()},
    }
    for kind, entries in rows.items():
        for index, (name, text) in enumerate(entries.items()):
            table.add_row(kind if index == 0 else "", name, text)
    _console().print(table)


@app.command("sweep")
def run_sweep(
    config: Annotated[Path | None, typer.Argument(help="TOML file; without it, the shipped default.")] = None,
    out: Annotated[Path, typer.Option(help="Results folder.")] = Path("results"),
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes for the accuracy part; all cores without it.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Dask scheduler that does the accuracy part, as tcp://host:8786.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the sweep in the results folder.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the sweep in the results folder.")] = False,
) -> None:
    """Run formulations x solvers x scenarios: accuracy in parallel, then times alone; print the table."""
    console = _console()
    store = Store(out)
    progress = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(markup=False, stderr=True),
        transient=True,
    )
    loaded = load_config(config)
    try:
        with progress, interruptible() as interrupted:
            bar = progress.add_task("starting")

            def on_progress(done: int, total: int, cell: str) -> None:
                interrupted()
                progress.update(bar, completed=done, total=total, description=cell)

            store = sweep(
                loaded, out, resume=resume, overwrite=overwrite, workers=workers, scheduler=scheduler,
                on_progress=on_progress,
            )  # fmt: skip
    except KeyboardInterrupt:
        if any((out / "ticks").glob("*.parquet")):
            console.print(sweep_table(store))
        again = " ".join(["kinqp sweep", *([str(config)] if config else []), "--out", str(out), "--resume"])
        console.print(f"Interrupted; {out} keeps all cells done. Next: {again}")
        raise typer.Exit(130) from None
    console.print(sweep_table(store))
    console.print(f"Wrote manifest.json, ticks and times of every cell to {out}. Next: kinqp report {out}")
    if store.unwritten:
        what, why = next(iter(store.unwritten.items()))
        console.print(f"{len(store.unwritten)} results could not be written, as {what}: {why}.")
        console.print("Next: make room, then the same command with --resume.")
        raise typer.Exit(1)


@app.command("export")
def run_export(
    robot: Annotated[str, typer.Option(help="Registered name, or a URDF file.")],
    formulation: Annotated[str, typer.Option(help="Registered name, or module:Name.")],
    mode: Annotated[list[str], typer.Option(help="Motion mode, e.g. fix-orientation or line:z; may be repeated.")],
    out: Annotated[Path, typer.Option(help="Folder to write to.")],
    tip: Annotated[str | None, typer.Option(help="Frame at the tool centre point, where the URDF branches.")] = None,
    name: Annotated[str | None, typer.Option(help="Prefix of files and symbols.")] = None,
    *,
    guiding: Annotated[bool, typer.Option("--guiding", help="With the hand-guiding controller around it.")] = False,
) -> None:
    """Write a formulation on a robot as a C library that checks itself; with --guiding, the whole controller."""
    export = export_guiding if guiding else export_c
    folder = export(load_robot(robot, tip=tip), formulation, mode, out, name=name)
    console = _console()
    console.print(f"Wrote {', '.join(sorted(path.name for path in folder.iterdir() if path.is_file()))} to {folder}.")
    build = folder / "build"
    console.print(f"Next: cmake -S {folder} -B {build} && cmake --build {build} && ctest --test-dir {build}")


@app.command("describe")
def run_describe(
    robot: Annotated[str, typer.Option(help="Registered name, or a URDF file.")],
    formulation: Annotated[str, typer.Option(help="Registered name, or module:Name.")],
    mode: Annotated[str, typer.Option(help="Motion mode, e.g. fix-orientation or line:z.")],
    spy: Annotated[Path | None, typer.Option(help="Draw the KKT matrix's pattern to this .png or .svg.")] = None,
    tip: Annotated[str | None, typer.Option(help="Frame at the tool centre point, where the URDF branches.")] = None,
) -> None:
    """Print the problem as Markdown with LaTeX: dimensions, named rows, run-time inputs."""
    arm, made = load_robot(robot, tip=tip), get_formulation(formulation)
    # Not through Rich: Markdown in a file must not be wrapped.
    typer.echo(made.describe(arm, mode), nl=False)
    if spy is not None:
        written = made.spy(arm, mode, spy)
        Console(markup=False, stderr=True, soft_wrap=True).print(
            f"Wrote {written}. Next: kinqp export, to have it as C."
        )


def _described(name: str, get: Callable[[str], object] = get_formulation) -> str:
    """First line of a formulation's docstring; what is wrong with it, where another package's can't be loaded."""
    try:
        return (type(get(name)).__doc__ or "").partition("\n")[0]
    except PluginError as error:
        return str(error)


def _console() -> Console:
    # A narrower terminal, or none, would cut figures off; wrapped lines can still be read.
    return Console(markup=False, width=max(TABLE_WIDTH, Console().width))


def main() -> None:
    """Run the command; what a user got wrong ends in one sentence and exit code 2, not in a traceback."""
    # A module beside one's work is found as `module:Name`, as with python -m; last, so that it hides nothing.
    sys.path.append(str(Path.cwd()))
    try:
        app()
    except USER_ERRORS as error:
        # A file's words are in it; a terminal would take some for commands.
        words = "\n".join(one_line(line) for line in str(error).splitlines())
        Console(markup=False, stderr=True, soft_wrap=True).print(f"kinqp: {words}", style="red", highlight=False)
        sys.exit(2)
