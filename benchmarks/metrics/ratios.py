"""Cells against each other: performance profiles and geometric means of ratios, over the records of a sweep."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import polars as pl

from .intervals import CONFIDENCE, RESAMPLES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# What makes cells comparable: the same problems, begun in the same way.
SAME_PROBLEMS: Final = ("scenario", "formulation", "start")


class RecordsError(ValueError):
    """Records can't be compared as asked; the message names the column, what was expected and what was got."""


def performance_profile(
    records: pl.DataFrame,
    column: str = "wall_p50",
    *,
    by: str = "solver",
    problem: Sequence[str] = SAME_PROBLEMS,
    success: float = 1.0,
) -> pl.DataFrame:
    """Performance profile (Dolan and More, Mathematical Programming 91, 2002).

    Who is `by` gets for every problem the ratio of its cost to the smallest cost of anyone on that problem, and
    rho(tau) is the share of problems on which that ratio is at most tau: rho(1) how often it was the best, and for
    large tau how often it solved the problem at all. A cell that did not, that has no such cost, or is missing counts
    as an infinite ratio. A problem that nobody solved counts for all.

    Parameters
    ----------
    records : pl.DataFrame
        One row per cell, as of `CellRecord.flat`.
    column : str
        The cost, positive; never a cost of one column against one of another.
    by : str
        Column of those who compete.
    problem : sequence of str
        Columns that together name a problem.
    success : float
        Share of ticks that must be right for a cell to count as solved.

    Returns
    -------
    pl.DataFrame
        Columns `by`, `tau`, `share`: all steps of every curve, from tau = 1 on.

    Raises
    ------
    RecordsError
        When a column is missing, a cost is not positive, or a problem has two cells of the same competitor.
    """
    cost = _costs(records, column, by, problem, success)
    ratio = cost / np.nanmin(
        np.where(np.isfinite(cost).any(axis=1, keepdims=True), cost, np.inf), axis=1, keepdims=True
    )
    ratio = np.where(np.isfinite(cost), ratio, np.inf)
    names = _names(records, by)
    taus = np.unique(np.append(ratio[np.isfinite(ratio)], 1.0))
    return pl.concat(
        pl.DataFrame({by: [name] * len(taus), "tau": taus, "share": (ratio[:, [k]] <= taus).mean(axis=0)})
        for k, name in enumerate(names)
    )


def geometric_means(
    records: pl.DataFrame,
    baseline: str,
    column: str = "wall_p50",
    *,
    by: str = "solver",
    problem: Sequence[str] = SAME_PROBLEMS,
    success: float = 1.0,
    seed: int = 0,
) -> pl.DataFrame:
    """Geometric mean, over problems, of the ratio of a cost to the baseline's on the same problem.

    Ratios have no unit and no scale, so nothing needs to be shifted: a mean of shifted seconds is the shift's. Only
    problems that both solved have a ratio; how many had none is a column. The interval is a bootstrap over problems:
    what other problems of the kind might have given.

    Parameters
    ----------
    records, column, by, problem, success
        As in `performance_profile`.
    baseline : str
        Whose cost all are divided by.
    seed : int
        Of the bootstrap.

    Returns
    -------
    pl.DataFrame
        Columns `by`, `ratio`, `low`, `high` (null where there is no problem in common), `problems`, `left_out`.

    Raises
    ------
    RecordsError
        As of `performance_profile`, or when nobody is called like the baseline.
    """
    cost = _costs(records, column, by, problem, success)
    names = _names(records, by)
    if baseline not in names:
        raise RecordsError(f"baseline: expected a {by} among {', '.join(names)}, got {baseline!r}")
    logarithms = np.log(cost) - np.log(cost[:, [names.index(baseline)]])
    rng = np.random.default_rng(seed)
    rows = []
    for k, name in enumerate(names):
        known = logarithms[np.isfinite(logarithms[:, k]), k]
        row: dict[str, object] = {by: name, "problems": known.size, "left_out": len(cost) - known.size}
        if known.size:
            drawn = known[rng.integers(known.size, size=(RESAMPLES, known.size))].mean(axis=1)
            tails = np.percentile(drawn, [50.0 * (1.0 - CONFIDENCE), 50.0 * (1.0 + CONFIDENCE)])
            row |= dict(zip(("ratio", "low", "high"), np.exp([known.mean(), *tails]).tolist(), strict=True))
        rows.append(row)
    schema = {by: pl.String, "ratio": pl.Float64, "low": pl.Float64, "high": pl.Float64,
              "problems": pl.Int64, "left_out": pl.Int64}  # fmt: skip
    return pl.DataFrame(rows, schema=schema)


def _names(records: pl.DataFrame, by: str) -> list[str]:
    return records[by].unique(maintain_order=True).to_list()


def _costs(records: pl.DataFrame, column: str, by: str, problem: Sequence[str], success: float) -> Array:
    """Costs of all problems (rows) and competitors (columns), NaN where a cell is missing, failed or has none."""
    for name in (column, by, *problem, "success"):
        if name not in records.columns:
            raise RecordsError(f"records: expected a column {name!r}, got {', '.join(records.columns)}")
    names, keys = _names(records, by), list(dict.fromkeys(records.select(problem).iter_rows()))
    row, position = {key: k for k, key in enumerate(keys)}, {name: k for k, name in enumerate(names)}
    cost = np.full((len(keys), len(names)), np.nan)
    seen = set()
    for record in records.iter_rows(named=True):
        cell = row[tuple(record[name] for name in problem)], position[record[by]]
        if cell in seen:
            raise RecordsError(f"records: expected one cell of {record[by]!r} for each of {keys[cell[0]]}, got two")
        seen.add(cell)
        value = record[column]
        if value is None or record["success"] < success:
            continue
        if not value > 0.0:
            raise RecordsError(f"records: {column}: expected positive costs, got {value} of {record[by]!r}")
        cost[cell] = value
    return cost
