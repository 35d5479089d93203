"""What inverse kinematics returns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class IkStatus(Enum):
    """How an inverse kinematics ended."""

    REACHED = "reached"
    """Within the tolerances of the target."""
    NEAREST = "nearest"
    """No start came within tolerance; the best of the nearest points that they ended in."""
    MAX_STEPS = "max steps"
    """Neither: the best start ran out of steps."""


@dataclass(frozen=True)
class IkResult:
    """What inverse kinematics found.

    Attributes
    ----------
    q : ndarray, shape (nv,)
        Within the limits, always [rad or m].
    status : IkStatus
    error : float
        Distance of the tool centre point from its target [m].
    angle : float
        Angle between the tool's orientation and its target [rad]; 0 where the mode leaves orientation alone.
    steps : int
        Steps (QPs) of the start that found `q`.
    total_steps : int
        Steps of all starts.
    starts : int
        Number of starts made; 1 where the first one reached the target.
    start : int
        Which of them found `q`; 0 is the one given.
    history : ndarray, shape (steps + 1, nv)
        Where the start that found `q` went, its first entry within the limits already [rad or m].
    """

    q: Array
    status: IkStatus
    error: float
    angle: float
    steps: int
    total_steps: int
    starts: int
    start: int
    history: Array
