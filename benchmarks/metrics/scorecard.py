"""The requirements scorecard: every controller against the ten requirements of the thesis (2.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import polars as pl
import polars.selectors as cs

from .kept import record_of
from .ratios import RecordsError
from .requirements import REQUIREMENTS

if TYPE_CHECKING:
    from ..store import Store
    from .requirements import Requirement

_CONTROLLER: Final = ("formulation", "solver", "start")


def records(store: Store) -> pl.DataFrame:
    """Make the records of all cells of a sweep that have been run, one row each; see `CellRecord`.

    They are kept in the folder, and made anew where a cell's files or this library have changed.

    Parameters
    ----------
    store : Store
        The results folder.
    """
    rows = [record_of(store, cell) for cell in store.cells()]
    # What no cell has is a column of numbers all the same.
    return pl.DataFrame(rows, infer_schema_length=None).with_columns(cs.by_dtype(pl.Null).cast(pl.Float64))


def scorecard(store: Store) -> pl.DataFrame:
    """Give the scorecard of a sweep; see `scorecard_of`.

    Parameters
    ----------
    store : Store
        The results folder.
    """
    return scorecard_of(records(store))


def scorecard_of(cells: pl.DataFrame) -> pl.DataFrame:
    """Give the scorecard of a sweep's records.

    Parameters
    ----------
    cells : pl.DataFrame
        One row per cell, as of `CellRecord.flat`.

    Returns
    -------
    pl.DataFrame
        One row per controller (`formulation`, `solver`, `start`; the last two of a baseline are "-") with `scenarios`,
        on how many it was run, and for each
        of `REQUIREMENTS` its value in the scenario where it was worst, `KEY`; that scenario, `KEY_scenario`; and
        whether it passes, `KEY_pass`. Null where no scenario measures it: not measured is not passed. `passed` and
        `measured` count.

    Raises
    ------
    RecordsError
        When a column is missing.
    """
    for name in (*_CONTROLLER, "scenario", *(f"requirement_{each.key}" for each in REQUIREMENTS)):
        if name not in cells.columns:
            raise RecordsError(f"records: expected a column {name!r}, got {', '.join(cells.columns)}")
    cells = cells.with_columns(cs.starts_with("requirement_").cast(pl.Float64))
    rows = []
    for key, group in cells.group_by(_CONTROLLER, maintain_order=True):
        row: dict[str, object] = dict(zip(_CONTROLLER, key, strict=True))
        row["scenarios"] = group["scenario"].n_unique()
        for each in REQUIREMENTS:
            row |= _worst(each, group)
        verdicts = [row[f"{each.key}_pass"] for each in REQUIREMENTS]
        row |= {"passed": verdicts.count(True), "measured": len(verdicts) - verdicts.count(None)}
        rows.append(row)
    return pl.DataFrame(rows, schema=_schema())


def _worst(requirement: Requirement, cells: pl.DataFrame) -> dict[str, object]:
    column, key = f"requirement_{requirement.key}", requirement.key
    known = cells.filter(pl.col(column).is_not_null() & pl.col(column).is_not_nan())
    if not len(known):
        return {key: None, f"{key}_pass": None, f"{key}_scenario": None}
    worst = known.sort(column, descending=not requirement.at_least, maintain_order=True).row(0, named=True)
    return {key: worst[column], f"{key}_pass": requirement.passes(worst[column]), f"{key}_scenario": worst["scenario"]}


def _schema() -> dict[str, type[pl.DataType]]:
    schema: dict[str, type[pl.DataType]] = {**dict.fromkeys(_CONTROLLER, pl.String), "scenarios": pl.Int64}
    for each in REQUIREMENTS:
        schema |= {each.key: pl.Float64, f"{each.key}_pass": pl.Boolean, f"{each.key}_scenario": pl.String}
    return {**schema, "passed": pl.Int64, "measured": pl.Int64}
