"""Fewer points that look the same: what is drawn of a long run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    Index = NDArray[np.int64]


def extremes(values: ArrayLike, buckets: int, *, group: ArrayLike | None = None) -> Index:
    """Pick the smallest and the largest value of each bucket of neighbours; every point drawn is one measured.

    An average would hide the one slow tick in a thousand, and every n-th point would lose it by chance.

    Parameters
    ----------
    values : array_like, shape (N,)
        In order. NaN is a gap: it is never picked from a bucket that holds anything else.
    buckets : int
        Number of buckets, at least one. With at most two values to a bucket all are kept.
    group : array_like of int, shape (N,), optional
        Ascending positions, where several values share one (repeats of a tick): buckets hold equally many of
        them. The values' own indices without it.

    Returns
    -------
    ndarray of int, shape (at most 2 x buckets,)
        Indices into `values`, ascending.

    Raises
    ------
    ValueError
        Naming the argument that is not usable.
    """
    if buckets < 1:
        raise ValueError(f"buckets: expected at least 1, got {buckets}")
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 1:
        raise ValueError(f"values: expected shape (N,), got {x.shape}")
    at = np.arange(x.size) if group is None else np.asarray(group, dtype=np.int64)
    if at.shape != x.shape or np.any(np.diff(at) < 0):
        raise ValueError(f"group: expected ascending positions of shape {x.shape}, got shape {at.shape}")
    if x.size <= 2 * buckets:
        return np.arange(x.size)
    _, at = np.unique(at, return_inverse=True)
    bucket = at * buckets // (int(at[-1]) + 1)
    starts = np.flatnonzero(np.diff(bucket, prepend=-1))
    low = np.where(np.isnan(x), np.inf, x)
    high = np.where(np.isnan(x), -np.inf, x)
    picked: set[int] = set()
    for begin, end in zip(starts, np.append(starts[1:], x.size), strict=True):
        picked.add(int(begin + np.argmin(low[begin:end])))
        picked.add(int(begin + np.argmax(high[begin:end])))
    return np.array(sorted(picked), dtype=np.int64)


# Dense where a control engineer looks: the far end.
_SHARES = np.unique(
    np.concatenate([np.linspace(0.0, 0.99, 100), np.linspace(0.99, 0.999, 19), np.linspace(0.999, 1.0, 21)])
)


def distribution(values: ArrayLike) -> tuple[Array, Array]:
    """Sample an empirical distribution where it matters.

    Parameters
    ----------
    values : array_like, shape (N,)
        At least one.

    Returns
    -------
    shares : ndarray, shape (M,)
        Share of the values that is at most... ascending to 1.
    at : ndarray, shape (M,)
        ...this: values that occurred, not interpolations.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    if not ordered.size:
        raise ValueError("values: expected at least one, got none")
    counts = np.unique(np.maximum(1, np.ceil(_SHARES * ordered.size - 1e-9).astype(np.int64)))
    return counts / ordered.size, ordered[counts - 1]
