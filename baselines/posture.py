"""A posture as the task of least priority."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .situation import Situation

    Array = NDArray[np.float64]


def check_gain(gain: float) -> None:
    """Refuse a posture's gain that is negative or not finite."""
    if not (np.isfinite(gain) and gain >= 0.0):
        raise ValueError(f"posture_gain: expected a number that is not negative [1/s], got {gain}")


def with_posture(at: Situation, gain: float) -> tuple[tuple[Array, Array], ...]:
    """Locked rows, the hand's rows and, with a gain [1/s], the way to the middle of the ranges: (J, xd) each."""
    if not gain:
        return at.tasks
    return (*at.tasks, (np.eye(at.nv)[at.limited], -gain * (at.q - at.middle)[at.limited]))
