"""Iterations and times per tick: figures 4.6, 4.7 and 4.8 of the thesis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..downsample import extremes
from ..series import CLOCKS, positions, samples
from .style import BUCKETS, figure

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ...scenarios import Scenario
    from .style import Series

    Curve = tuple[NDArray[np.int64], NDArray[np.float64]]


def iterations_figure(series: Sequence[Series], scenario: Scenario) -> Figure | None:
    """Iterations per tick, one panel per formulation and solver (figure 4.6); None where nothing was run."""

    def curve(one: Series) -> Curve | None:
        if one.ticks is None or not len(one.ticks) or one.ticks["iterations"].has_nulls():
            return None
        values = one.ticks["iterations"].to_numpy().astype(float)
        at = extremes(values, BUCKETS)
        return positions(one.ticks, scenario)[at], values[at]

    return _grid(series, scenario, curve, "iterations", kind="line")


def times_figure(series: Sequence[Series], scenario: Scenario, clock: str, *, cut: bool) -> Figure | None:
    """Time per tick by one clock, all repeats (figure 4.7), or cut at the 95th percentile (figure 4.8).

    Returns
    -------
    Figure or None
        None where no cell has that clock.
    """

    def curve(one: Series) -> Curve | None:
        found = None if one.times is None else samples(one.times, clock)
        if found is None or not found.seconds.size:
            return None
        found = found.cut() if cut else found
        at = extremes(found.seconds, BUCKETS, group=found.tick)
        return found.tick[at], 1e6 * found.seconds[at]

    made = _grid(series, scenario, curve, "time [µs]", kind="cut" if cut else "times")
    if made is not None:
        made.suptitle(f"Clock: {CLOCKS[clock]}" + ("; cut at the 95th percentile" if cut else ""), fontsize=8)
    return made


def _grid(
    series: Sequence[Series], scenario: Scenario, curve: Callable[[Series], Curve | None], label: str, *, kind: str
) -> Figure | None:
    curves = {one.case.cell: (one, found) for one in series if (found := curve(one)) is not None}
    if not curves:
        return None
    formulations = list(dict.fromkeys(cell.formulation for cell in curves))
    solvers = list(dict.fromkeys(cell.solver for cell in curves))
    made, axes = figure(len(solvers), len(formulations), 0.95, sharex="all", sharey="row")
    for axis in (axis for row in axes for axis in row):
        axis.set_visible(False)
    for cell, (one, (tick, values)) in curves.items():
        row, column = solvers.index(cell.solver), formulations.index(cell.formulation)
        axis = axes[row][column]
        axis.set_visible(True)
        x = tick * scenario.dt if scenario.states is None else tick
        if kind == "line" and scenario.states is None:
            axis.plot(x, values, color=one.colour, linewidth=0.6)
        else:
            axis.plot(x, values, ".", color=one.colour, markersize=2.5, markeredgewidth=0.0)
        axis.set_title(cell.formulation if cell.is_baseline else f"{cell.formulation}, {cell.solver}", loc="left")
        if kind == "times":
            axis.set_yscale("log")
        if row == len(solvers) - 1:
            axis.set_xlabel("time [s]" if scenario.states is None else "state")
    if kind != "times":
        # After all is drawn: setting a limit ends its adapting to what comes.
        for line in axes:
            line[0].set_ylim(bottom=0.0)
    made.supylabel(label, fontsize=8)
    return made
