"""`kinqp certify`: the most iterations that a state's ticks can take, proved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from ..benchmarks.certify import (
    Certificate,
    Certificates,
    DependentRowsError,
    Slice,
    SliceError,
    attained_again,
    certify,
    drawn_states,
    parse_side,
    read_certificates,
    read_state,
    write_certificates,
)
from ..benchmarks.conditions import conditions
from ..codegen import compile_step
from ..control import make_step
from ..formulations import get_formulation
from ..robots import load_robot
from .interrupt import interruptible

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..codegen import CompiledStep

_WIDTH = 200


def run_certify(
    robot: Annotated[str | None, typer.Option(help="Registered name, or a URDF file.")] = None,
    mode: Annotated[str, typer.Option(help="Motion mode, e.g. fix-orientation or line:z.")] = "fix-orientation",
    formulation: Annotated[str, typer.Option(help="cartesian-error, with options if wanted.")] = "cartesian-error",
    state: Annotated[
        list[Path] | None, typer.Option(help="File of kinqp worst-case, or of q and limits; may be repeated.")
    ] = None,
    states: Annotated[int, typer.Option(min=1, help="How many states to draw, without --state.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="Of these.")] = 0,
    speed: Annotated[float, typer.Option(help="Most that the hand asks for along each axis [m/s, rad/s].")] = 3.0,
    any_hand: Annotated[
        bool, typer.Option("--any-hand", help="Whatever the hand asks for, in place of --speed.")
    ] = False,
    free: Annotated[
        list[str] | None, typer.Option(help="Side of a joint with any bound, as 3:lower; may be repeated.")
    ] = None,
    out: Annotated[Path, typer.Option(help="File to write to.")] = Path("certificates.json"),
    tip: Annotated[str | None, typer.Option(help="Frame at the tool centre point, where the URDF branches.")] = None,
    replayed: Annotated[
        Path | None, typer.Option("--replay", help="Run again what attains the bounds instead.")
    ] = None,
) -> None:
    """Prove how many iterations the active set takes at most, at given states, for every hand."""
    # A narrower terminal, or none, would break columns; wrapped lines can still be read.
    console = Console(markup=False, soft_wrap=True, width=max(_WIDTH, Console().width))
    if replayed is not None:
        _run_again(console, replayed)
        return
    if robot is None:
        raise SliceError("certify: expected --robot, or --replay FILE")
    arm = load_robot(robot, tip=tip)
    sides = tuple(parse_side(text, arm.nv) for text in free or ())
    made = get_formulation(formulation)
    interpreted = make_step(arm, made, mode)
    fastest = None if any_hand else speed
    Slice(interpreted, np.zeros(arm.nv), free=sides, speed=fastest)  # refuses before anything is compiled
    console.print(f"compiling {formulation} on {robot}, {mode} ...", highlight=False)
    compiled = compile_step(arm, made, mode)
    picked = [read_state(path, arm.nv) for path in state] if state else drawn_states(compiled, states, seed)
    slices = [Slice(interpreted, q, limits, sides, fastest) for q, limits in picked]
    found, refused, interrupted = _certified(slices, compiled, seed)
    result = Certificates(robot, tip, formulation, mode, found, refused, conditions())
    write_certificates(result, out)
    _print(console, result)
    if interrupted:
        console.print(f"Interrupted after {len(found) + len(refused)} of {len(slices)} states; what is proved is kept.")
    console.print(f"Wrote {len(found)} certificates to {out}. Next: kinqp certify --replay {out}")
    if any(each.agreement.differing for each in found):
        console.print("The compiled tick differs from what is proved: this should not be, and deserves a report.")
        raise typer.Exit(1)


def _certified(
    slices: Sequence[Slice], step: CompiledStep, seed: int
) -> tuple[list[Certificate], list[dict[str, object]], bool]:
    columns = TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
    progress = Progress(*columns, console=Console(markup=False, stderr=True), transient=True)
    found: list[Certificate] = []
    refused: list[dict[str, object]] = []
    try:
        with progress, interruptible() as interrupted:
            bar = progress.add_task("certifying", total=len(slices))

            def on_progress(regions: int, most: int, share: float) -> None:
                interrupted()
                text = f"state {len(found) + len(refused) + 1} of {len(slices)}: {regions} regions, {most} iterations"
                progress.update(bar, description=text, completed=len(found) + len(refused) + share)

            for each in slices:
                try:
                    found.append(certify(each, step, seed=seed, on_progress=on_progress))
                except DependentRowsError as error:
                    limits = {name: values.tolist() for name, values in each.limits.items()}
                    refused.append({"q": each.q.tolist(), "limits": limits, "reason": str(error)})
    except KeyboardInterrupt:
        return found, refused, True
    return found, refused, False


def _print(console: Console, result: Certificates) -> None:
    console.print(f"{result.formulation} on {result.robot}, {result.mode}", highlight=False)
    table = Table(box=None, padding=(0, 2, 0, 0))
    heads = (
        "state",
        "bound",
        "without ties",
        "compiled",
        "regions",
        "cpu s",
        "ticks run",
        "differ",
        "tolerated",
        "refused",
        "q",
    )
    for head in heads:
        table.add_column(head)
    for index, each in enumerate(result.certificates):
        counts = (
            *(index, each.iterations, each.attained.proved, each.attained.compiled, sum(each.regions.values())),
            *(f"{each.seconds:.1f}", each.agreement.compared, each.agreement.differing),
            *(each.agreement.tolerated, each.agreement.refused),
        )
        q = np.array2string(np.array(each.q), precision=3, separator=", ", max_line_width=_WIDTH)
        table.add_row(*(str(count) for count in counts), q)
    console.print(table)
    for refused in result.refused:
        console.print(f"Refused at q = {refused['q']}: {refused['reason']}", highlight=False)


def _run_again(console: Console, path: Path) -> None:
    result = read_certificates(path)
    _print(console, result)
    same = True
    for index, (each, (compiled, exact)) in enumerate(zip(result.certificates, attained_again(result), strict=True)):
        console.print(
            f"state {index}: v = {each.attained.v} takes {compiled} iterations compiled, {exact} in exact arithmetic",
            highlight=False,
        )
        same &= (compiled, exact) == (each.attained.compiled, each.attained.proved)
    console.print("As proved." if same else "Not as proved.")
    if not same:
        raise typer.Exit(1)
