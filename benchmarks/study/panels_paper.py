"""Panels for a paper."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.ticker import NullLocator

from ..report.paper.style import DASHES, figure
from .panels import Band, Bars, Boxes, Line, log_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from .panels import Panel, PanelFigure

_ROW: Final = 1.45
# Of the places side by side in a category, how much bars and boxes fill.
_FILL: Final = 0.8


def to_paper(described: PanelFigure) -> Figure:
    """Draw panels at the width of a paper; within `report.paper.style.style`."""
    made, axes = figure(
        len(described.rows),
        len(described.rows[0]),
        _ROW,
        sharey="row" if described.share_y else "none",
        sharex="col" if described.share_x else "none",
    )
    for i, row in enumerate(described.rows):
        for j, panel in enumerate(row):
            axis = axes[i][j]
            if panel is None:
                axis.set_visible(False)
                continue
            _draw(axis, panel)
            axis.set_title(panel.title, loc="left")
            if i == len(described.rows) - 1 or not described.share_x:
                axis.set_xlabel(panel.x_label)
            if j == 0 or not described.share_y:
                axis.set_ylabel(panel.y_label)
    handles: dict[str, Any] = {}
    for axis in (axis for row in axes for axis in row):
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        made.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=min(len(handles), 8))
    return made


def _draw(axis: Axes, panel: Panel) -> None:
    grouped = [content for content in panel.contents if isinstance(content, Bars | Boxes)]
    # In the order in which they first appear.
    categories = list(dict.fromkeys(name for content in grouped for name in content.categories))
    slots = list(dict.fromkeys(_slot(content) for content in grouped))
    for content in panel.contents:
        match content:
            case Line():
                axis.plot(
                    content.x, content.y, color=content.colour, linestyle=DASHES[content.style],
                    linewidth=0.6 * content.width, label=content.name or None,
                )  # fmt: skip
            case Band():
                axis.fill_between(
                    content.x, content.low, content.high, color=content.colour, alpha=0.16, linewidth=0.4,
                    label=content.name,
                )  # fmt: skip
            case Bars() | Boxes():
                width = _FILL / len(slots)
                offset = (slots.index(_slot(content)) - 0.5 * (len(slots) - 1)) * width
                places = offset + np.array([categories.index(name) for name in content.categories])
                _in_groups(axis, content, places, width)
    if grouped:
        axis.set_xticks(np.arange(len(categories)), categories)
        axis.grid(visible=False, axis="x")
    if panel.log_y:
        axis.set_yscale("log")
        marks = log_ticks(panel)
        if marks is not None:
            low, high = axis.get_ylim()
            marks = marks[(marks >= low) & (marks <= high)]
            axis.set_yticks(marks, [f"{mark:g}" for mark in marks])
            axis.yaxis.set_minor_locator(NullLocator())
    if panel.y_range is not None:
        axis.set_ylim(*panel.y_range)


def _slot(content: Bars | Boxes) -> str:
    return content.name if isinstance(content, Bars) else content.slot


def _in_groups(axis: Axes, content: Bars | Boxes, places: NDArray[np.float64], width: float) -> None:
    if isinstance(content, Bars):
        axis.bar(places, content.heights, 0.92 * width, color=content.colour, label=content.name)
        return
    line: dict[str, Any] = {"color": content.colour, "linewidth": 0.8}
    axis.boxplot(
        list(content.values), positions=places, widths=0.7 * width, showfliers=False, manage_ticks=False, whis=(0, 100),
        boxprops=line, whiskerprops=line, capprops=line, medianprops={**line, "linewidth": 1.6},
    )  # fmt: skip
    rng = np.random.default_rng(0)
    for place, values in zip(places, content.values, strict=True):
        axis.plot(
            place + rng.uniform(-0.22, 0.22, len(values)) * width, values, ".", color=content.colour, markersize=2.0,
            markeredgewidth=0.0, alpha=0.5,
        )  # fmt: skip
    # For the legend alone: boxes have no place there.
    axis.plot([], [], color=content.colour, linewidth=4.0, label=content.name)
