"""The sweep's table, in the shape of the thesis's table 4.3 and figures 4.6-4.8."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from .scenarios import get_scenario
from .summary import CellSummary, cell_summary

if TYPE_CHECKING:
    from rich.console import RenderableType

    from .cells import Cell
    from .scenarios import Scenario
    from .store import Store

# Width that all columns need; a narrower terminal would fold figures.
TABLE_WIDTH = 190


def sweep_table(store: Store) -> RenderableType:
    """Make the table of all cells that have been run, with its conditions below, and what failed.

    Parameters
    ----------
    store : Store
        The results folder.
    """
    manifest = store.manifest
    parts: list[RenderableType] = []
    cells: dict[str, list[Cell]] = {}
    for cell in store.cells():
        cells.setdefault(cell.scenario, []).append(cell)
    for name, done in cells.items():
        scenario = get_scenario(name)
        parts.append(
            _scenario_table(
                scenario, [(cell, cell_summary(store.ticks(cell), store.times(cell), scenario)) for cell in done]
            )
        )
    parts.append(
        Text(
            "iter: iterations per tick. time: update + solve through Python per tick, over timed ticks and repeats; "
            "own: the solve by the solver's own timer, C: the solve in C, both p50; set-up: a full one, p50. fixed "
            "rows: largest error of a locked row [m/s, rad/s]. bound: largest excess over a joint velocity bound "
            "[rad/s]. acc: largest joint acceleration over its limit, of all joints and of the watched ones. wrong: "
            "ticks that did not end as the scenario expects. on limit: share of ticks with a watched joint on its "
            "limit. eps: mean norm of the Cartesian error [m/s]."
        )
    )
    for what, why in manifest.skipped.items():
        parts.append(Text(f"skipped: {what}: {why}"))
    timings = {cell.solver: store.outcome(cell).timing for cell in store.cells()}
    for solver, timing in timings.items():
        notes = timing.notes if timing is not None else ()
        parts += [Text(f"{solver}: {note}") for note in notes if note.startswith("own is the") or "set-up" in note]
    for cell, why in store.failed().items():
        parts.append(Text(f"failed: {cell}: {why}"))
    parts.append(Text("; ".join(f"{key} {value}" for key, value in manifest.conditions.items())))
    return Group(*parts)


def _scenario_table(scenario: Scenario, rows: list[tuple[Cell, CellSummary]]) -> Table:
    joints = ", ".join(str(joint + 1) for joint in scenario.watched_joints) or "none"
    length = "states" if scenario.states is not None else f"ticks of {1e3 * scenario.dt:g} ms"
    table = Table(
        title=f"{scenario.name}: {scenario.robot.name}, {', '.join(map(str, scenario.modes))}, {scenario.ticks} "
        f"{length}, watched joints: {joints}",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for column in ("formulation", "solver", "start"):
        table.add_column(column, no_wrap=True)
    columns = (
        "iter\nmean", "\np99", "\nmax", "time us\np50", "\np95", "\np99", "\nmax", "own\nus", "C\nus", "set-up\nus",
        "fixed\nrows", "bound", "acc\nall", "\nwatched", "wrong\n%", "on limit\n%", "eps\nm/s",
    )  # fmt: skip
    for column in columns:
        table.add_column(column, justify="right", vertical="bottom", no_wrap=True)
    last = ""
    for cell, m in rows:
        time = () if m.time is None else (m.time.p50, m.time.p95, m.time.p99, m.time.max)
        counts = (math.nan,) * 3
        if m.iterations is not None:
            counts = (m.iterations.mean, m.iterations.p99, m.iterations.max)
        table.add_row(
            cell.formulation if cell.formulation != last else "",
            cell.solver,
            cell.start,
            *(_figure(x, form) for x, form in zip(counts, (".2f", ".0f", ".0f"), strict=True)),
            *(_figure(1e6 * x, ".0f") for x in time or (math.nan,) * 4),
            _figure(1e6 * m.own, ".1f"),
            _figure(1e6 * m.c, ".1f"),
            _figure(1e6 * m.setup, ".0f"),
            f"{m.fixed_error:.1e}",
            f"{m.bound_violation:.1e}",
            _figure(m.peak_acceleration, ".4f"),
            _figure(m.watched_acceleration, ".4f"),
            f"{100 * m.failed:.2f}",
            _figure(100 * m.on_limit, ".1f"),
            f"{m.task_error:.4f}",
        )
        last = cell.formulation
    return table


def _figure(value: float, form: str) -> str:
    return "-" if math.isnan(value) else format(value, form)
