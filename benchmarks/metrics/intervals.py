"""Percentiles with intervals that say how far to believe them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Integers = NDArray[np.int64]

# Of the intervals.
CONFIDENCE: Final = 0.95
RESAMPLES: Final = 400
# With at least so many repeats these are what is resampled, with fewer it is blocks of consecutive samples.
ENOUGH_REPEATS: Final = 8
# Samples of a block, at least: longer than what a scheduler's tick or a cold cache leaves behind. And blocks, at most.
BLOCK: Final = 50
MOST_BLOCKS: Final = 100


@dataclass(frozen=True)
class Estimate:
    """A number and the interval of `CONFIDENCE` around it; all None where there is nothing to estimate from."""

    value: float | None
    low: float | None
    high: float | None


def clusters(tick: Integers, repeat: Integers) -> Integers:
    """Say what belongs together when samples are resampled: shape (N,), numbered from 0.

    The ticks of a cell are the same problems in every repeat: what another measurement would change is not the
    problems but the machine's state, which is one for a whole repeat. So repeats are drawn, each with all its
    ticks. With fewer than `ENOUGH_REPEATS` of them there is nothing to draw from, and up to `MOST_BLOCKS` blocks of
    at least `BLOCK` consecutive samples stand in (of a tenth of the samples where these are few); they miss what
    differs from repeat to repeat, and the intervals are then too narrow rather than too wide.

    Parameters
    ----------
    tick, repeat : ndarray of int, shape (N,)
        Where each sample comes from.
    """
    _, number = np.unique(repeat, return_inverse=True)
    if number.size and number.max() + 1 >= ENOUGH_REPEATS:
        return number.astype(np.int64)
    size = max(1, min(BLOCK, len(tick) // 10), -(-len(tick) // MOST_BLOCKS))
    position = np.empty(len(tick), dtype=np.int64)
    position[np.lexsort((tick, repeat))] = np.arange(len(tick))
    return position // size


def percentiles(
    values: Array, cluster: Integers, levels: Sequence[float], *, seed: int = 0, resamples: int = RESAMPLES
) -> tuple[Estimate, ...]:
    """Percentiles that occurred, with bootstrap intervals by resampling clusters.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Samples; at least one.
    cluster : ndarray of int, shape (N,)
        What is drawn together, numbered from 0; see `clusters`.
    levels : sequence of float
        In per cent; 100 is the maximum. No resample exceeds the largest value seen, so that the interval of the
        maximum, and of a percentile beyond 1 - 1/N, says nothing about its upper side.
    seed : int
        Of the draws.
    resamples : int
        How many.

    Returns
    -------
    tuple of Estimate
        One for each level; the percentile method of the intervals.
    """
    order = np.argsort(values, kind="stable")
    ordered, owner = values[order], cluster[order]
    count = int(cluster.max()) + 1
    # Samples of each cluster among the first 1, 2, ... of all in order: what a draw weighs is a sum over clusters.
    below = np.cumsum(owner[:, None] == np.arange(count), axis=0, dtype=np.float64)
    shares = np.asarray(levels, dtype=float) / 100.0
    weights = np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), size=resamples)
    (values_at,) = ordered[_positions(below, np.ones((1, count)), shares)]
    drawn = ordered[_positions(below, weights.astype(np.float64), shares)]
    tails = [50.0 * (1.0 - CONFIDENCE), 50.0 * (1.0 + CONFIDENCE)]
    low, high = np.percentile(drawn, tails, axis=0, method="inverted_cdf")
    return tuple(Estimate(float(v), float(a), float(b)) for v, a, b in zip(values_at, low, high, strict=True))


def _positions(below: Array, weights: Array, shares: Array) -> Integers:
    """First positions with at least such shares of the weight up to them, shape (draws, shares); by bisection."""
    # Rounding down by a hair, or 0.95 of 200 would be the 191st.
    wanted = shares * (weights @ below[-1])[:, None] * (1.0 - 1e-12)
    low = np.zeros(wanted.shape, dtype=np.int64)
    high = np.full(wanted.shape, len(below) - 1)
    while np.any(low < high):
        middle = (low + high) // 2
        enough = np.einsum("dsc,dc->ds", below[middle], weights) >= wanted
        low, high = np.where(enough, low, middle + 1), np.where(enough, middle, high)
    return low
