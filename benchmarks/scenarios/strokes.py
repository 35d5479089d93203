"""A hand that pulls in strokes, each from rest to rest, whatever the arm does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

# Time in which the hand reaches its speed, and stops [s].
RAMP: Final = 0.15


@dataclass(frozen=True)
class Stroke:
    """One pull.

    Attributes
    ----------
    twist : tuple of 6 floats
        Linear and angular velocity between the ramps [m/s, rad/s]; zero for a rest.
    duration : float
        From rest to rest [s], at least two ramps.
    frame : {"world", "tool"}
        Whose axes the twist is counted along; the tool's turn with it.
    """

    twist: tuple[float, ...]
    duration: float
    frame: Literal["world", "tool"] = "world"

    def __post_init__(self) -> None:
        if len(self.twist) != 6 or not np.isfinite(self.twist).all():
            raise ValueError(f"stroke: expected a twist of 6 finite numbers, got {self.twist}")
        if self.duration < 2.0 * RAMP:
            raise ValueError(f"stroke: expected at least two ramps of {RAMP:g} s, got {self.duration:g} s")


@dataclass(frozen=True)
class Strokes:
    """Strokes one after the other, then rest; a `Guide`."""

    strokes: tuple[Stroke, ...]

    @property
    def duration(self) -> float:
        """Of all strokes [s]."""
        return sum(stroke.duration for stroke in self.strokes)

    def twist(self, t: float, pose: Array) -> Array:
        """Twist asked for at time `t` [s] with the tool at `pose` (4, 4): shape (6,), world axes [m/s, rad/s]."""
        for stroke in self.strokes:
            if t < stroke.duration:
                share = _smooth(t / RAMP) * _smooth((stroke.duration - t) / RAMP)
                twist: Array = share * np.array(stroke.twist)
                if stroke.frame == "tool":
                    twist = (pose[:3, :3] @ twist.reshape(2, 3).T).T.reshape(6)
                return twist
            t -= stroke.duration
        return np.zeros(6)


def pull(direction: ArrayLike, speed: float, length: float) -> Stroke:
    """Make a straight pull along world axes.

    Parameters
    ----------
    direction : array_like, shape (3,)
        Of any length but zero.
    speed : float
        Between the ramps [m/s].
    length : float
        What is asked for in all [m].
    """
    unit = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    return Stroke((*(float(x) for x in speed * unit), 0.0, 0.0, 0.0), length / speed + RAMP)


def rest(duration: float = 0.3) -> Stroke:
    """Let the hand rest [s]."""
    return Stroke((0.0,) * 6, duration)


def strokes(*parts: Stroke | Sequence[Stroke]) -> Strokes:
    """Put strokes, and lists of them, in a row."""
    return Strokes(tuple(s for part in parts for s in ((part,) if isinstance(part, Stroke) else part)))


def _smooth(x: float) -> float:
    """Quintic step: speed, acceleration and its change begin and end at zero."""
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
