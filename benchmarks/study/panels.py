"""A figure of panels side by side, described once and drawn twice: for the page and for a paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from ..report.downsample import extremes
from ..report.palette import COLOURS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

#: One colour for an algorithm, wherever it appears.
ALGORITHM_COLOURS: Final = {"A": COLOURS[1], "B": COLOURS[0], "C": COLOURS[2]}
#: And for a character.
CHARACTER_COLOURS: Final = {"expert": "#22313f", "novice": "#b58b2a"}
LIMIT_COLOUR: Final = "#b3261e"
GREY: Final = "#8a8f98"


@dataclass(frozen=True)
class Line:
    """A curve.

    Attributes
    ----------
    name : str
        For the legend; empty: not in it.
    x, y : ndarray, shape (N,)
    colour : str
        As `#rrggbb`.
    style : {"solid", "dash", "dot"}
    width : float
        Of the line [px on the page].
    """

    name: str
    x: Array
    y: Array
    colour: str
    style: Literal["solid", "dash", "dot"] = "solid"
    width: float = 1.4


@dataclass(frozen=True)
class Band:
    """An area between two curves over the same x, shape (N,) each."""

    name: str
    x: Array
    low: Array
    high: Array
    colour: str = GREY


@dataclass(frozen=True)
class Bars:
    """Heights over categories, side by side with those of other `Bars`."""

    name: str
    categories: tuple[str, ...]
    heights: tuple[float, ...]
    colour: str


@dataclass(frozen=True)
class Boxes:
    """Distributions over categories: box, median and every value.

    Attributes
    ----------
    name : str
    categories : tuple of str
    values : tuple of ndarray, shape (N,) each
    colour : str
    slot : str
        Boxes of one category stand side by side where their slots differ.
    """

    name: str
    categories: tuple[str, ...]
    values: tuple[Array, ...]
    colour: str
    slot: str


# Decades on a logarithmic axis beyond which only these are marked.
_WIDE: Final = 2.5

Content = Line | Band | Bars | Boxes


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    title, x_label, y_label : str
    contents : tuple of Line, Band, Bars or Boxes
    log_y : bool
    y_range : tuple of (float, float), optional
        What is shown; of the data without it.
    """

    title: str
    x_label: str
    y_label: str
    contents: tuple[Content, ...]
    log_y: bool = False
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True)
class PanelFigure:
    """Panels in rows.

    Attributes
    ----------
    key : str
        Name of its files, without suffix.
    title, caption : str
    rows : tuple of tuple of Panel
        Of equal length; None leaves a place empty.
    share_y : bool
        Whether the panels of a row have one y axis.
    share_x : bool
        Whether the panels of a column have one x axis.
    row_height : float
        On the page [px].
    """

    key: str
    title: str
    caption: str
    rows: tuple[tuple[Panel | None, ...], ...]
    share_y: bool = False
    share_x: bool = False
    row_height: float = 240.0

    @property
    def panels(self) -> tuple[Panel, ...]:
        """All that are there."""
        return tuple(panel for row in self.rows for panel in row if panel is not None)


def log_ticks(panel: Panel) -> Array | None:
    """Values to be marked on a logarithmic axis, 1, 2 and 5 times the powers of ten; None: powers of ten will do."""
    low, high = _span(panel)
    if np.log10(high / low) > _WIDE:
        return None
    powers = np.arange(np.floor(np.log10(low)) - 1, np.ceil(np.log10(high)) + 1)
    marks = np.multiply.outer(10.0**powers, [1.0, 2.0, 5.0]).ravel()
    return np.asarray(marks[(marks >= 0.5 * low) & (marks <= 2.0 * high)])


def _span(panel: Panel) -> tuple[float, float]:
    """Smallest and largest positive value of a panel's lines and boxes; (1, 1) where there is none."""
    values = [one.y for one in panel.contents if isinstance(one, Line)]
    values += [some for one in panel.contents if isinstance(one, Boxes) for some in one.values]
    every = np.concatenate(values) if values else np.ones(1)
    positive = every[every > 0.0]
    return (float(positive.min()), float(positive.max())) if positive.size else (1.0, 1.0)


def thinned(
    name: str,
    x: Array,
    y: ArrayLike,
    colour: str,
    *,
    buckets: int,
    style: Literal["solid", "dash", "dot"] = "solid",
    width: float = 1.4,
) -> Line:
    """Make a curve of the smallest and largest value of each of so many stretches: no spike is lost."""
    values = np.asarray(y, dtype=np.float64)
    at = extremes(values, buckets)
    return Line(name, x[at], values[at], colour, style, width)


def in_rows(panels: Sequence[Panel], columns: int) -> tuple[tuple[Panel | None, ...], ...]:
    """Arrange panels one after the other; what the last row lacks stays empty."""
    filled: list[Panel | None] = [*panels, *[None] * (-len(panels) % columns)]
    return tuple(tuple(filled[at : at + columns]) for at in range(0, len(filled), columns))
