"""How figures for a paper look, and how they are written."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

import matplotlib as mpl
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import polars as pl
    from matplotlib.axes import Axes

    from ..source import Case

Share = Literal["none", "all", "row", "col"]

# Two columns of a conference paper [inch].
WIDTH: Final = 7.16
BUCKETS: Final = 600
DASHES: Final = {"solid": "-", "dash": "--", "dot": ":"}
_STYLE: Final[dict[Any, Any]] = {
    "font.size": 8, "axes.titlesize": 8, "axes.labelsize": 8, "xtick.labelsize": 7, "ytick.labelsize": 7,
    "legend.fontsize": 7, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.alpha": 0.25,
    "grid.linewidth": 0.5, "lines.linewidth": 1.0, "axes.linewidth": 0.6, "legend.frameon": False,
    "savefig.dpi": 300, "svg.hashsalt": "kinqp", "axes.axisbelow": True, "axes.titleweight": "bold",
}  # fmt: skip


@dataclass(frozen=True)
class Series:
    """A cell in a figure.

    Attributes
    ----------
    case : Case
    ticks, times : pl.DataFrame or None
        Its frames.
    colour, dash : str
    """

    case: Case
    ticks: pl.DataFrame | None
    times: pl.DataFrame | None
    colour: str
    dash: str


@contextmanager
def style() -> Iterator[None]:
    """Draw in the house's style within; what others draw is left alone."""
    with mpl.rc_context(_STYLE):
        yield


def figure(
    rows: int,
    columns: int,
    row_height: float,
    *,
    extra: float = 0.6,
    sharex: Share = "none",
    sharey: Share = "none",
) -> tuple[Figure, list[list[Axes]]]:
    """Make a figure of the paper's width with a grid of axes, rows of `row_height` and `extra` for the rest [inch]."""
    made = Figure(figsize=(WIDTH, rows * row_height + extra), layout="constrained")
    axes = made.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey)
    return made, [list(row) for row in axes]


def save(made: Figure, stem: Path) -> list[Path]:
    """Write a figure as PNG and SVG; the same figure gives the same bytes."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    written = []
    for kind, metadata in (("png", {"Software": None}), ("svg", {"Date": None})):
        path = stem.with_name(f"{stem.name}.{kind}")
        made.savefig(path, metadata=metadata)
        written.append(path)
    return written
