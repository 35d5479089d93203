"""`kinqp davinci`: the study of a da Vinci arm."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console


def run_davinci(
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("davinci"),
) -> None:
    """Workspace, inverse kinematics, spiral and trajectories of a da Vinci arm, as figures, data and a page."""
    # Here, because sympy and plotly take a second to import, which no other command should wait for.
    from ..benchmarks.davinci import run_davinci as run

    console = Console(markup=False, soft_wrap=True)
    with console.status("starting") as status:
        found = run(out, on_stage=lambda stage: status.update(stage))
    figures = found.summary()
    example = figures["example"]
    console.print(f"A_8^12: 16 entries compared, different: {figures['matrix']['different']}", highlight=False)
    console.print(
        f"inverse kinematics: {example['error_mm']:.1e} mm after {example['steps']} steps, within bounds",
        highlight=False,
    )
    for spiral in figures["spirals"]:
        console.print(
            f"spiral of {spiral['points']}: {spiral['reached']} reached, error {spiral['mean_error_mm']:.3f} mm mean, "
            f"{spiral['largest_error_mm']:.2f} mm at most; second opinion agrees to "
            f"{spiral['second_opinion_off_by_mm']:.1e} mm",
            highlight=False,
        )
    console.print(f"Wrote index.html, summary.json, A_8_12.tex, data and figures to {out}. Next: open {out}/index.html")
