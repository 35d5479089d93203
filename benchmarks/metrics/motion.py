"""Measures of how an arm moves: chatter, jumps, limits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# How close to its limit a joint counts as being on it [rad or m].
ON_LIMIT: Final = 1e-6
# A sign change of an acceleration counts where both sides exceed this share of the limit.
CHATTER_SHARE: Final = 0.01
# A command jumps where a joint's changes from one tick to the next by more than this many times qdd_max dt.
JUMP_SHARE: Final = 2.0


def sign_changes(acceleration: Array) -> int:
    """Count sign changes between ticks with both sides above `CHATTER_SHARE`, over all joints.

    Parameters
    ----------
    acceleration : ndarray, shape (N, nv)
        As shares of the limits.
    """
    before, after = acceleration[:-1], acceleration[1:]
    large = np.minimum(np.abs(before), np.abs(after)) > CHATTER_SHARE
    return int(np.sum((before * after < 0.0) & large))


def beyond(q: Array, q_min: Array, q_max: Array) -> Array:
    """How far each joint is beyond its limits, zero inside, in the shape of `q` [rad or m]."""
    excess: Array = np.maximum(np.maximum(q - q_max, q_min - q), 0.0)
    return excess


def overshoot(q: Array, q_min: Array, q_max: Array) -> float:
    """How far a joint went beyond its limits, counted from the least far that it had been until then [rad or m].

    A joint that starts beyond a limit and comes back has none; one that is pushed further out has, and so has one that
    was inside in between.

    Parameters
    ----------
    q : ndarray, shape (N, nv)
        In order of time.
    q_min, q_max : ndarray, shape (nv,)
        Limits.
    """
    excess = beyond(q, q_min, q_max)
    return float(np.max(excess - np.minimum.accumulate(excess, axis=0)))
