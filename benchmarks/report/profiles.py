"""Performance profiles and mean ratios, by every clock; the numbers are the metrics'."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import polars as pl

from ..cells import NONE
from ..metrics import geometric_means, performance_profile

if TYPE_CHECKING:
    from collections.abc import Sequence

_PROBLEM: Final = ("scenario", "formulation")
_BY: Final = "competitor"


@dataclass(frozen=True)
class Curve:
    """One competitor's curve.

    Attributes
    ----------
    name, solver, start : str
    ratio, share : list of float
        Share of problems within so many times the fastest.
    """

    name: str
    solver: str
    start: str
    ratio: list[float]
    share: list[float]


@dataclass(frozen=True)
class Mean:
    """One competitor's geometric mean of ratios to the baseline; None without a common problem."""

    name: str
    ratio: float | None
    low: float | None
    high: float | None
    problems: int
    left_out: int


@dataclass(frozen=True)
class Profile:
    """All competitors by one column of times.

    Attributes
    ----------
    curves : tuple of Curve
        Of those with at least one time.
    baseline : str
        Whose time the means are relative to.
    means : tuple of Mean
    problems : int
        Scenario x formulation pairs.
    """

    curves: tuple[Curve, ...]
    baseline: str
    means: tuple[Mean, ...]
    problems: int


def competitor(solver: str, start: str) -> str:
    """What a solver with one kind of start is called."""
    return solver if start == "cold" else f"{solver}, from last {start}"


def profile(records: pl.DataFrame, column: str, starts: Sequence[str]) -> Profile | None:
    """Set solvers, each with each of its starts, against each other on all scenarios and formulations.

    Baselines have no solver, and nobody else solves what they do: they have no part in it.

    Parameters
    ----------
    records : pl.DataFrame
        One row per cell.
    column : str
        Which time.
    starts : sequence of str
        In the order in which they are listed.

    Returns
    -------
    Profile or None
        None where no cell has that time.
    """
    if column not in records.columns:
        return None
    # A timer too coarse for a solve reads zero, which has no ratio.
    cells = records.filter(pl.col("solver") != NONE).with_columns(
        pl.when(pl.col(column) > 0.0).then(pl.col(column)).alias(column),
    )
    names = [competitor(*names) for names in cells.select("solver", "start").iter_rows()]
    cells = cells.with_columns(pl.Series(_BY, names, dtype=pl.String))
    timed = cells.filter(pl.col(column).is_not_null())[_BY].unique(maintain_order=True).to_list()
    cells = cells.filter(pl.col(_BY).is_in(timed))
    if not timed:
        return None
    steps = performance_profile(cells, column, by=_BY, problem=_PROBLEM)
    of = {row[_BY]: (row["solver"], row["start"]) for row in cells.iter_rows(named=True)}
    order = sorted(timed, key=lambda name: starts.index(of[name][1]))
    curves = tuple(
        Curve(name, *of[name], *(steps.filter(pl.col(_BY) == name)[key].to_list() for key in ("tau", "share")))
        for name in order
    )
    means = geometric_means(cells, order[0], column, by=_BY, problem=_PROBLEM)
    rows = {
        row[_BY]: Mean(row[_BY], row["ratio"], row["low"], row["high"], row["problems"], row["left_out"])
        for row in means.iter_rows(named=True)
    }
    return Profile(curves, order[0], tuple(rows[name] for name in order), cells.select(_PROBLEM).n_unique())
