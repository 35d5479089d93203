"""The sweep's table, in the shape of the thesis's table 4.3 and figures 4.6-4.8."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from .metrics import CellMetrics, cell_metrics
from .scenarios import get_scenario
from .store import cells_of

if TYPE_CHECKING:
    from rich.console import RenderableType

    from .scenarios import Scenario
    from .store import Cell, Store

# Width that all columns need; a narrower terminal would fold figures.
TABLE_WIDTH = 170


def sweep_table(store: Store) -> RenderableType:
    """Make the table of all cells that have at least one run, with its conditions below.

    Parameters
    ----------
    store : Store
        The results folder.
    """
    config, conditions = store.manifest()
    parts: list[RenderableType] = []
    samples = 0
    for name in config.scenarios:
        scenario = get_scenario(name)
        done = [cell for cell in cells_of(config) if cell.scenario == name and store.repeats_done(cell)]
        rows = [(cell, cell_metrics(store.read(cell), scenario)) for cell in done]
        if rows:
            parts.append(_scenario_table(scenario, rows))
            samples = max(samples, *(metrics.time.samples for _, metrics in rows))
    parts.append(
        Text(
            "iter: iterations per tick. time: update + solve through Python per tick, over all ticks and runs (up to "
            f"{samples} samples a cell). set-up: the first tick's, median of the runs. fixed rows: largest error of a "
            "locked row [m/s, rad/s]. bound: largest excess over a joint velocity bound [rad/s]. acc: largest joint "
            "acceleration over its limit, of all joints and of the watched one. failed: ticks that ended in the safe "
            "stop. on limit: share of ticks with the watched joint on its limit. eps: mean norm of the Cartesian error "
            "[m/s]."
        )
    )
    parts.append(Text("; ".join(f"{key} {value}" for key, value in conditions.items())))
    return Group(*parts)


def _scenario_table(scenario: Scenario, rows: list[tuple[Cell, CellMetrics]]) -> Table:
    ticks = rows[0][1].ticks
    runs = sorted({metrics.repeats for _, metrics in rows})
    joint = scenario.watched_joints[0] + 1
    table = Table(
        title=f"{scenario.name}: {scenario.robot.name}, {scenario.mode}, {ticks} ticks of {1e3 * scenario.dt:g} ms, "
        f"{' to '.join(map(str, {runs[0], runs[-1]}))} runs, watched: joint {joint}",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for column in ("formulation", "solver"):
        table.add_column(column, no_wrap=True)
    columns = (
        "iter\nmean", "\np99", "\nmax", "time us\np50", "\np95", "\np99", "\nmax", "\nstd", "set-up\nus",
        "fixed\nrows", "bound", "acc\nall", "\nwatched", "failed\n%", "on limit\n%", "eps\nm/s",
    )  # fmt: skip
    for column in columns:
        table.add_column(column, justify="right", vertical="bottom", no_wrap=True)
    last = ""
    for cell, m in rows:
        table.add_row(
            cell.formulation if cell.formulation != last else "",
            cell.solver,
            f"{m.iterations.mean:.2f}",
            f"{m.iterations.p99:.0f}",
            f"{m.iterations.max:.0f}",
            *(f"{1e6 * x:.0f}" for x in (m.time.p50, m.time.p95, m.time.p99, m.time.max, m.time.std)),
            f"{1e6 * m.setup:.0f}",
            f"{m.fixed_error:.1e}",
            f"{m.bound_violation:.1e}",
            f"{m.peak_acceleration:.4f}",
            f"{m.watched_acceleration:.4f}",
            f"{100 * m.failed:.2f}",
            f"{100 * m.on_limit:.1f}",
            f"{m.task_error:.4f}",
        )
        last = cell.formulation
    return table
