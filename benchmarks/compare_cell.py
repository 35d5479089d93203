"""One cell of two sweeps: what it answered and how many iterations that took, compared exactly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

if TYPE_CHECKING:
    import polars as pl
    from numpy.typing import NDArray

    from .scenarios import Scenario

    Array = NDArray[np.float64]

Verdict = Literal["worse", "changed", "better"]

#: A residual below this counts as rounding; above it, one that is `GROWTH` times as large got worse.
THRESHOLDS: Final = {"fixed_error": 1e-9, "bound_violation": 1e-9, "reference_error": 1e-6}
GROWTH: Final = 1.1
_MEANING: Final = {
    "fixed_error": "largest error of a locked row [m/s, rad/s]",
    "bound_violation": "largest excess over a joint velocity bound [rad/s or m/s]",
    "reference_error": "largest difference from the reference's command [rad/s or m/s]",
}
# States closer than this are the same problem: [rad or m].
_SAME_STATE: Final = 1e-9


@dataclass(frozen=True)
class Finding:
    """One thing that differs in one cell.

    Attributes
    ----------
    cell, measure : str
    verdict : {"worse", "changed", "better"}
        "changed" is neither: it differs, and nothing says for the better or the worse.
    a, b : float or None
        Before and after; None where a side has none.
    text : str
        The same in words.
    ratio : float or None
        Times only: B over A.
    interval : tuple of float or None
        Of the ratio.
    """

    cell: str
    measure: str
    verdict: Verdict
    a: float | None
    b: float | None
    text: str
    ratio: float | None = None
    interval: tuple[float, float] | None = None


def correctness(cell: str, failed_a: str, failed_b: str) -> list[Finding]:
    """Compare whether a cell could be run at all; the reasons are empty where it could."""
    if bool(failed_a) == bool(failed_b):
        return []
    if failed_b:
        return [Finding(cell, "cell failed", "worse", 0.0, 1.0, failed_b)]
    return [Finding(cell, "cell failed", "better", 1.0, 0.0, f"before: {failed_a}")]


def compare_ticks(cell: str, a: pl.DataFrame, b: pl.DataFrame, scenario: Scenario) -> list[Finding]:
    """Compare two runs of a cell tick by tick.

    Parameters
    ----------
    cell : str
        What to call it.
    a, b : pl.DataFrame
        As the store's `ticks` gives them: before, after.
    scenario : Scenario
        Its `expects` is the right answer.
    """
    found = _counted(cell, a, b, scenario) + _residuals(cell, a, b)
    if len(a) != len(b) or not np.array_equal(a["t"].to_numpy(), b["t"].to_numpy()):
        text = f"{len(a)} ticks before, {len(b)} after: not the same run, iterations were not compared"
        return [*found, Finding(cell, "ticks", "changed", len(a), len(b), text)]
    return found + _iterations(cell, a, b)


def _counted(cell: str, a: pl.DataFrame, b: pl.DataFrame, scenario: Scenario) -> list[Finding]:
    found = []
    for measure, in_a, in_b in (
        ("failed ticks", _failed(a, scenario), _failed(b, scenario)),
        ("dishonest ticks", _dishonest(a), _dishonest(b)),
    ):
        if in_a != in_b:
            verdict: Verdict = "worse" if in_b > in_a else "better"
            what = f"not {scenario.expects.value}" if measure == "failed ticks" else "claimed solved, and was not"
            found.append(Finding(cell, measure, verdict, in_a, in_b, f"{in_a} to {in_b} of {len(b)}: {what}"))
    return found


def _failed(ticks: pl.DataFrame, scenario: Scenario) -> int:
    return int((ticks["status"] != scenario.expects.value).sum())


def _dishonest(ticks: pl.DataFrame) -> int:
    """Ticks at which the solver said solved, and our residuals say it is not."""
    return int(((ticks["claimed"] == "solved") & (ticks["status"] != "solved")).sum())


def _residuals(cell: str, a: pl.DataFrame, b: pl.DataFrame) -> list[Finding]:
    found = []
    for name, threshold in THRESHOLDS.items():
        in_a, in_b = _largest(a[name]), _largest(b[name])
        if in_a is None or in_b is None:
            continue
        verdict: Verdict
        if in_b > max(threshold, GROWTH * in_a):
            verdict = "worse"
        elif in_a > max(threshold, GROWTH * in_b):
            verdict = "better"
        else:
            continue
        found.append(Finding(cell, name, verdict, in_a, in_b, f"{in_a:.1e} to {in_b:.1e}: {_MEANING[name]}"))
    return found


def _largest(values: pl.Series) -> float | None:
    numbers = values.cast(float).to_numpy()
    finite = numbers[np.isfinite(numbers)]
    return float(finite.max()) if finite.size else None


def _iterations(cell: str, a: pl.DataFrame, b: pl.DataFrame) -> list[Finding]:
    """Compare iterations on the ticks that asked the same question, exactly."""
    q_a, q_b = (np.array(frame["q"].to_list(), dtype=np.float64) for frame in (a, b))
    same = np.max(np.abs(q_a - q_b), axis=1) <= _SAME_STATE
    found = []
    if not same.all():
        first = float(a["t"].to_numpy()[~same][0])
        text = (
            f"{int((~same).sum())} of {len(a)} ticks are at other states, from t = {first:g} s: iterations of the rest"
        )
        found.append(Finding(cell, "states", "changed", 0.0, float((~same).sum()), text))
    if a["iterations"].has_nulls() or b["iterations"].has_nulls():
        return found  # a solver that tells none
    in_a, in_b = (frame["iterations"].to_numpy()[same].astype(np.int64) for frame in (a, b))
    if not in_a.size or np.array_equal(in_a, in_b):
        return found
    more, fewer = int(np.sum(in_b > in_a)), int(np.sum(in_b < in_a))
    total_a, total_b = int(in_a.sum()), int(in_b.sum())
    largest_a, largest_b = int(in_a.max()), int(in_b.max())
    text = f"total {total_a} to {total_b}, most {largest_a} to {largest_b}: more at {more} ticks, fewer at {fewer}"
    verdict: Verdict = "changed"
    if total_b > total_a or largest_b > largest_a:
        verdict = "worse"
    elif total_b < total_a or largest_b < largest_a:
        verdict = "better"
    return [*found, Finding(cell, "iterations", verdict, total_a, total_b, text)]
