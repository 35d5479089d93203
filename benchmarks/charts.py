"""A chart, described once and drawn twice: as a picture (matplotlib) and for a page (plotly)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

Style = Literal["line", "dash", "points", "circles", "fill", "mesh", "cloud", "heights"]

#: Colours that people with any colour vision tell apart (Okabe and Ito).
BLUE, ORANGE, GREEN, RED, GREY = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#8a8f98"
# How many corners of a mesh the picture shows; the page has all of it.
_PICTURE_POINTS: Final = 6_000


@dataclass(frozen=True)
class Series:
    """What is drawn in one colour under one name.

    Parameters
    ----------
    name : str
        For the legend; empty: not in it.
    x, y : ndarray, shape (N,)
        NaN breaks a line.
    style : Style
        `heights` are points coloured by z, `cloud` small faint ones, `circles` hollow ones.
    colour : str
        As `#rrggbb`.
    z : ndarray, shape (N,), optional
        Makes it three-dimensional.
    triangles : ndarray of int, shape (F, 3), optional
        Of a mesh.
    """

    name: str
    x: Array
    y: Array
    style: Style
    colour: str
    z: Array | None = None
    triangles: NDArray[np.int64] | None = None


@dataclass(frozen=True)
class Chart:
    """One chart.

    Parameters
    ----------
    key : str
        Name of its files, without suffix.
    title, caption : str
    labels : tuple of 2 or 3 str
        Of the axes, with units.
    series : tuple of Series
    equal : bool
        Same scale on x and y.
    log_y : bool
    """

    key: str
    title: str
    caption: str
    labels: tuple[str, ...]
    series: tuple[Series, ...] = field(repr=False)
    equal: bool = False
    log_y: bool = False


def save_png(chart: Chart, path: Path) -> None:
    """Draw a chart to a PNG file."""
    # Here, because it takes a second to import, which who does not draw should not wait for.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    solid = len(chart.labels) == 3
    figure = Figure(figsize=(8.0, 6.0) if solid or chart.equal else (8.0, 4.2), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.add_subplot(projection="3d" if solid else None)
    for series in chart.series:
        _draw(axes, series, solid=solid)
    axes.set_title(chart.title, fontsize=11)
    axes.set_xlabel(chart.labels[0])
    axes.set_ylabel(chart.labels[1])
    if solid:
        axes.set_zlabel(chart.labels[2])
        axes.set_box_aspect((1.0, 1.0, 0.5))
    else:
        axes.grid(color="#dddddd", linewidth=0.6)
        axes.set_axisbelow(True)
        if chart.equal:
            axes.set_aspect("equal", adjustable="datalim")
        if chart.log_y:
            axes.set_yscale("log")
    if any(series.name for series in chart.series):
        axes.legend(fontsize=8, loc="best")
    figure.savefig(path)


def _draw(axes: Any, series: Series, *, solid: bool) -> None:
    place = [series.x, series.y, *([series.z] if solid and series.z is not None else [])]
    common = {"color": series.colour, "label": series.name or None}
    match series.style:
        case "line" | "dash":
            axes.plot(*place, linestyle="-" if series.style == "line" else "--", linewidth=1.3, **common)
        case "fill":
            axes.fill(*place, alpha=0.18, linewidth=1.0, **common)
        case "circles":
            axes.plot(*place, linestyle="", marker="o", markersize=6, fillstyle="none", **common)
        case "points":
            axes.plot(*place, linestyle="", marker="o", markersize=3, **common)
        case "heights":
            step = max(1, len(series.x) // _PICTURE_POINTS)
            axes.scatter(*(p[::step] for p in place), s=2.0, c=place[-1][::step], label=series.name or None)
        case "mesh" | "cloud":
            step = max(1, len(series.x) // _PICTURE_POINTS)
            axes.plot(*(p[::step] for p in place), linestyle="", marker=".", markersize=1.5, alpha=0.5, **common)


def to_plotly(chart: Chart) -> Any:
    """Make the chart a `plotly.graph_objects.Figure`."""
    import plotly.graph_objects as go

    solid = len(chart.labels) == 3
    figure = go.Figure([_trace(go, series, solid=solid) for series in chart.series])
    axes = dict(zip(("xaxis", "yaxis", "zaxis"), ({"title": {"text": label}} for label in chart.labels), strict=False))
    figure.update_layout(
        template="plotly_white",
        title={"text": chart.title, "font": {"size": 15}},
        margin={"l": 60, "r": 20, "t": 50, "b": 50},
        height=520 if solid or chart.equal else 380,
        legend={"orientation": "h", "y": -0.18},
    )
    if solid:
        view = {"eye": {"x": 0.85, "y": -1.8, "z": 1.5}}
        figure.update_layout(
            scene={**axes, "camera": view, "aspectmode": "manual", "aspectratio": {"x": 1.2, "y": 1.2, "z": 0.6}}
        )
        return figure
    figure.update_layout(**axes)
    if chart.equal:
        figure.update_yaxes(scaleanchor="x")
    if chart.log_y:
        figure.update_yaxes(type="log", exponentformat="power")
    return figure


def _trace(go: Any, series: Series, *, solid: bool) -> Any:
    # Single precision halves the page; a seventh digit is not seen.
    place = {"x": series.x.astype(np.float32), "y": series.y.astype(np.float32)}
    if solid and series.z is not None:
        place["z"] = series.z.astype(np.float32)
    common = {"name": series.name, "showlegend": bool(series.name), **place}
    if series.style == "mesh" and series.triangles is not None:
        i, j, k = series.triangles.astype(np.int32).T
        return go.Mesh3d(**common, i=i, j=j, k=k, color=series.colour, opacity=0.35, flatshading=True, hoverinfo="skip")
    kind = go.Scatter3d if solid else go.Scatter
    line: dict[str, Any] = {"color": series.colour, "width": 3 if solid else 1.6}
    marker: dict[str, Any]
    match series.style:
        case "line" | "dash":
            return kind(**common, mode="lines", line={**line, "dash": "dash" if series.style == "dash" else "solid"})
        case "fill":
            return kind(**common, mode="lines", line=line, fill="toself", fillcolor=_faint(series.colour))
        case "circles":
            marker = {"symbol": "circle-open", "size": 5 if solid else 8, "color": series.colour}
        case "heights":
            marker = {"size": 2.5 if len(series.x) < _PICTURE_POINTS else 1.3, "color": place.get("z", series.colour)}
            marker |= {"colorscale": "Viridis", "opacity": 0.7}
        case "cloud" | "mesh":
            marker = {"size": 1.5 if solid else 2.5, "color": series.colour, "opacity": 0.6}
        case _:
            marker = {"size": 3 if solid else 5, "color": series.colour}
    return kind(**common, mode="markers", marker=marker)


def _faint(colour: str) -> str:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.18)"
