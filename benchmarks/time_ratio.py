"""How much slower one run of a solver is than another, with an interval that knows the machine's noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    import polars as pl
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Fewer repeats on either side say nothing about noise.
MIN_REPEATS: Final = 5
_RESAMPLES: Final = 4000
# Columns that make up each of the three times; they are never mixed.
_COLUMNS: Final = {"wall": ("wall_update", "wall_solve"), "own": ("own",), "c": ("c",)}
#: The three clocks by name.
CLOCKS: Final = tuple(_COLUMNS)


@dataclass(frozen=True)
class TimeRatio:
    """Time of B over that of A on the same problems, by one clock.

    Attributes
    ----------
    clock : {"wall", "own", "c"}
    statistic : {"typical", "p99"}
        Geometric mean over ticks, or their 99th percentile; of each repeat, then the median over repeats.
    ratio, low, high : float
        Estimate and bootstrap interval.
    a, b : float
        The two times [s].
    ticks : int
        Problems that both were timed on.
    repeats : tuple of int
        Of A and B.
    """

    clock: str
    statistic: str
    ratio: float
    low: float
    high: float
    a: float
    b: float
    ticks: int
    repeats: tuple[int, int]


def time_ratios(a: pl.DataFrame, b: pl.DataFrame, *, confidence: float = 0.99, seed: int = 0) -> list[TimeRatio]:
    """Compare two cells' `times` frames by every clock that both have.

    The problems are the same on both sides, so what is random is the machine: whole repeats are resampled, which lie
    scattered over each sweep and carry its slow and its fast minutes.

    Parameters
    ----------
    a, b : pl.DataFrame
        As the store's `times` gives them.
    confidence : float
        Of the interval, between 0 and 1.
    seed : int
        Of the resampling.

    Returns
    -------
    list of TimeRatio
        Empty where there are no common ticks, or fewer than `MIN_REPEATS` repeats on a side.
    """
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence: expected a number between 0 and 1, got {confidence}")
    found = []
    for clock in CLOCKS:
        of_a, of_b = _by_repeat(a, clock), _by_repeat(b, clock)
        common = sorted(of_a.keys() & of_b.keys())
        if not common:
            continue
        ticks_a, ticks_b = (np.array([of[tick] for tick in common]) for of in (of_a, of_b))
        if min(ticks_a.shape[1], ticks_b.shape[1]) < MIN_REPEATS:
            continue
        rng = np.random.default_rng(seed)
        for statistic in ("typical", "p99"):
            log_a, log_b = _per_repeat(ticks_a, statistic), _per_repeat(ticks_b, statistic)
            draws = _resampled(log_b, rng) - _resampled(log_a, rng)
            tail = 50.0 * (1.0 - confidence)
            low, high = np.percentile(draws, [tail, 100.0 - tail])
            estimate_a, estimate_b = float(np.median(log_a)), float(np.median(log_b))
            found.append(
                TimeRatio(
                    clock, statistic, float(np.exp(estimate_b - estimate_a)), float(np.exp(low)), float(np.exp(high)),
                    float(np.exp(estimate_a)), float(np.exp(estimate_b)), len(common), (log_a.size, log_b.size),
                )
            )  # fmt: skip
    return found


def _by_repeat(times: pl.DataFrame, clock: str) -> dict[int, Array]:
    """Logarithms of times of each tick, one entry per repeat; ticks that not every repeat has are left out."""
    seconds = np.sum([times[name].cast(float).to_numpy() for name in _COLUMNS[clock]], axis=0).astype(np.float64)
    tick, repeat = times["tick"].to_numpy(), times["repeat"].to_numpy()
    # A timer's resolution may be too coarse for the fastest solves; they have no ratio.
    # Nor has a tick that a replay sets the solver up at, which has no update: it is not what a control cycle pays.
    there = np.isfinite(seconds) & (seconds > 0.0) & times["wall_update"].is_not_null().to_numpy()
    order = np.lexsort((repeat[there], tick[there]))
    ticks, values = tick[there][order], np.log(seconds[there][order])
    unique, counts = np.unique(ticks, return_counts=True)
    if not unique.size:
        return {}
    full = counts.max()
    starts = np.cumsum(counts) - counts
    return {
        int(one): values[start : start + full]
        for one, start, count in zip(unique, starts, counts, strict=True)
        if count == full
    }


def _per_repeat(log_times: Array, statistic: str) -> Array:
    """Statistic over ticks of each repeat, shape (repeats,), of logarithms with shape (ticks, repeats)."""
    if statistic == "typical":
        mean: Array = log_times.mean(axis=0)
        return mean
    tail: Array = np.percentile(log_times, 99.0, axis=0, method="inverted_cdf")
    return tail


def _resampled(values: Array, rng: np.random.Generator) -> Array:
    draws = rng.integers(values.size, size=(_RESAMPLES, values.size))
    medians: Array = np.median(values[draws], axis=1)
    return medians
