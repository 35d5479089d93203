"""`kinqp study`: the thesis's experiment with simulated operators."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from .interrupt import interruptible

_MARKS = {True: "holds", False: "does not hold", None: "not judged"}


def run_study(
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("study"),
    operators: Annotated[int, typer.Option(min=1, help="How many simulated people.")] = 42,
    trials: Annotated[int, typer.Option(min=1, help="How often each tries each algorithm.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="Of all that is drawn.")] = 2018,
    dt: Annotated[float, typer.Option(help="Control period [s]; the hard stop's peak goes with its inverse.")] = 1e-3,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the study in the folder.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the study in the folder.")] = False,
) -> None:
    """Guide an arm into its elbow limit under task priority, saturation in the null space and the QP; write a page."""
    # Here, because drawing takes a second to import, which no other command should wait for.
    from ..benchmarks.study import study_settings
    from ..benchmarks.study.command import run_and_write

    console, errors = Console(markup=False, soft_wrap=True, highlight=False), Console(markup=False, stderr=True)
    progress = Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=errors, transient=True,
    )  # fmt: skip
    settings = study_settings(operators=operators, trials=trials, seed=seed, dt=dt)
    try:
        with progress, interruptible() as interrupted:
            bar = progress.add_task("trials")

            def on_trial(done: int, total: int) -> None:
                interrupted()
                progress.update(bar, completed=done, total=total)

            def on_stage(stage: str) -> None:
                interrupted()
                progress.update(bar, description=stage)

            written = run_and_write(
                settings, out, processes=workers, resume=resume, overwrite=overwrite, on_trial=on_trial,
                on_stage=on_stage,
            )  # fmt: skip
    except KeyboardInterrupt:
        again = f"kinqp study --out {out} --operators {operators} --trials {trials} --seed {seed} --dt {dt:g}"
        console.print(
            f"Interrupted; {out} keeps all trials done. Next: {again} --workers {workers} --resume", markup=False
        )
        raise typer.Exit(130) from None
    for verdict in written.findings.verdicts:
        console.print(f"{_MARKS[verdict.holds]}: {verdict.expected}: {verdict.measured}", markup=False)
    for one in written.findings.questionnaire.comparisons:
        if one.printed is not None:
            value = one.completed[0] if one.completed else one.test.statistic
            told = f"thesis, question {one.question + 1}, A and C: chi-squared {value:.2f}, printed {one.printed:.2f}"
            console.print(told, markup=False)
    console.print(
        f"Wrote index.html ({written.page.stat().st_size / 1e6:.1f} MB), summary.json, trials.parquet, runs and "
        f"{len(written.figures)} figures to {out}. Next: open {written.page} in a browser; it needs no network.",
        markup=False,
    )
