"""The scorecard as a table of marks; values and verdicts are the metrics'."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from ..cells import NONE
from ..metrics import REQUIREMENTS, scorecard_of

if TYPE_CHECKING:
    import polars as pl

Kind = Literal["pass", "fail", "none"]


@dataclass(frozen=True)
class Mark:
    """One field.

    Attributes
    ----------
    text : str
        The value where it was worst.
    kind : {"pass", "fail", "none"}
    where : str
        In which scenario.
    """

    text: str
    kind: Kind
    where: str


@dataclass(frozen=True)
class Row:
    """One controller; `marks` are in the order of `REQUIREMENTS`."""

    formulation: str
    solver: str
    start: str
    scenarios: int
    passed: int
    measured: int
    marks: tuple[Mark, ...]

    @property
    def is_baseline(self) -> bool:
        """Whether it is a baseline, without solver and start."""
        return self.solver == NONE


def scorecard_rows(records: pl.DataFrame) -> list[Row]:
    """Rows of the scorecard, those that pass most first; none without records."""
    if not len(records):
        return []
    rows = []
    for one in scorecard_of(records).iter_rows(named=True):
        marks = []
        for each in REQUIREMENTS:
            value, passes = one[each.key], one[f"{each.key}_pass"]
            kind: Kind = "none" if passes is None else "pass" if passes else "fail"
            marks.append(Mark("\u2013" if value is None else short(value), kind, one[f"{each.key}_scenario"] or ""))
        names = (one["formulation"], one["solver"], one["start"], one["scenarios"], one["passed"], one["measured"])
        rows.append(Row(*names, tuple(marks)))
    return sorted(rows, key=lambda row: (-row.passed, row.measured - row.passed))


def short(value: float) -> str:
    """A number for a narrow field."""
    size = abs(value)
    if value == 0.0:
        return "0"
    return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e") if size < 1e-3 or size >= 1e4 else f"{value:.3g}"
