"""Panels for the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from .panels import Band, Bars, Boxes, Line, log_ticks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .panels import Content, Panel, PanelFigure

_BACKGROUND: Final = "#ffffff"
# What titles, legend and axis labels take beside the rows [px].
_AROUND: Final = 120


def to_plotly(figure: PanelFigure) -> Any:
    """Make panels a `plotly.graph_objects.Figure`; one click in the legend hides a name in all of them."""
    from plotly.subplots import make_subplots

    count = len(figure.rows[0])
    height = len(figure.rows) * figure.row_height + _AROUND
    made = make_subplots(
        rows=len(figure.rows),
        cols=count,
        shared_yaxes="rows" if figure.share_y else False,
        shared_xaxes="columns" if figure.share_x else False,
        horizontal_spacing=0.04 if figure.share_y else 0.2 / count,
        vertical_spacing=(45.0 if figure.share_x else 85.0) / height if len(figure.rows) > 1 else 0.0,
        subplot_titles=[panel.title if panel else "" for row in figure.rows for panel in row],
    )
    named: set[str] = set()
    for i, row in enumerate(figure.rows, start=1):
        for j, panel in enumerate(row, start=1):
            if panel is not None:
                _fill(made, panel, i, j, named)
                last = i == len(figure.rows) or not figure.share_x
                made.update_xaxes(title_text=panel.x_label if last else "", row=i, col=j)
                if j == 1 or not figure.share_y:
                    made.update_yaxes(title_text=panel.y_label, row=i, col=j)
    made.update_annotations(font={"size": 13})
    made.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 70, "r": 15, "t": 34, "b": 50},
        legend={"orientation": "h", "y": -60.0 / height, "yanchor": "top", "x": 0.0},
        paper_bgcolor=_BACKGROUND,
        plot_bgcolor=_BACKGROUND,
        barmode="group",
        boxmode="group",
        hovermode="closest",
        font={"size": 12},
    )
    return made


def _fill(made: Any, panel: Panel, i: int, j: int, named: set[str]) -> None:
    for content in panel.contents:
        for trace in _traces(content):
            # A name is in the legend once, whichever panel has it first.
            trace.showlegend = bool(trace.name) and trace.showlegend is not False and trace.name not in named
            trace.legendgroup = trace.name or None
            if trace.showlegend:
                named.add(trace.name)
            made.add_trace(trace, row=i, col=j)
    axis: dict[str, Any] = {}
    if panel.log_y:
        marks = log_ticks(panel)
        axis["type"] = "log"
        axis |= (
            {"exponentformat": "power", "dtick": 1}
            if marks is None
            else {"tickvals": marks.tolist(), "ticktext": [f"{mark:g}" for mark in marks]}
        )
    if panel.y_range is not None:
        axis["range"] = list(np.log10(panel.y_range)) if panel.log_y else list(panel.y_range)
    if axis:
        made.update_yaxes(row=i, col=j, **axis)


def _traces(content: Content) -> list[Any]:
    import plotly.graph_objects as go

    match content:
        case Line():
            line = {"color": content.colour, "width": content.width, "dash": content.style}
            place = {"x": _short(content.x), "y": _short(content.y)}
            return [go.Scatter(**place, name=content.name, mode="lines", line=line)]
        case Band():
            x = _short(content.x)
            edge = {"color": content.colour, "width": 0.7}
            fill = {"fill": "tonexty", "fillcolor": _faint(content.colour), "hoverinfo": "skip"}
            return [
                go.Scatter(x=x, y=_short(content.low), name=content.name, mode="lines", line=edge, showlegend=False),
                go.Scatter(x=x, y=_short(content.high), name=content.name, mode="lines", line=edge, **fill),
            ]
        case Bars():
            return [
                go.Bar(
                    x=list(content.categories), y=list(content.heights), name=content.name,
                    marker={"color": content.colour},
                )
            ]  # fmt: skip
        case Boxes():
            categories = np.repeat(content.categories, [len(values) for values in content.values])
            return [
                go.Box(
                    x=categories.tolist(), y=_short(np.concatenate(content.values)), name=content.name,
                    offsetgroup=content.slot, boxpoints="all", jitter=0.55, pointpos=0.0, line={"width": 1.3},
                    marker={"size": 3, "opacity": 0.55, "color": content.colour}, fillcolor=_faint(content.colour),
                )
            ]  # fmt: skip


def _short(values: NDArray[np.float64]) -> NDArray[np.float32]:
    # Single precision halves the page; a seventh digit is not seen.
    return np.asarray(values, dtype=np.float32)


def _faint(colour: str) -> str:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.16)"
