"""Paths for the hand, and a follower that turns them into the velocity it asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Path(Protocol):
    """A curve for the tool centre point, by arc length."""

    @property
    def length(self) -> float:
        """Arc length of the whole [m]."""

    def point(self, s: float) -> Array:
        """Position at arc length `s`, shape (3,) in the world [m]."""

    def tangent(self, s: float) -> Array:
        """Unit tangent at arc length `s`, shape (3,) in the world."""


@dataclass(frozen=True)
class SemicirclePath:
    """Half a circle.

    Parameters
    ----------
    start : ndarray, shape (3,)
        Where it begins, in the world [m].
    across : ndarray, shape (3,)
        Unit vector from its beginning to its end.
    over : ndarray, shape (3,)
        Unit vector from its centre to its middle, perpendicular to `across`.
    radius : float
        [m].
    """

    start: Array
    across: Array
    over: Array
    radius: float

    def __post_init__(self) -> None:
        for name, vector in (("across", self.across), ("over", self.over)):
            if not np.isclose(np.linalg.norm(vector), 1.0, atol=1e-9):
                raise ValueError(f"{name}: expected a unit vector, got {vector}")
        if abs(self.across @ self.over) > 1e-9 or not self.radius > 0.0:
            raise ValueError(
                f"semicircle: expected perpendicular axes and a positive radius, got {self.across}, {self.over}, "
                f"{self.radius}"
            )

    @property
    def length(self) -> float:
        """Arc length of the whole [m]."""
        return np.pi * self.radius

    def point(self, s: float) -> Array:
        """Position at arc length `s`, shape (3,) in the world [m]."""
        angle = s / self.radius
        point: Array = self.start + self.radius * ((1.0 - np.cos(angle)) * self.across + np.sin(angle) * self.over)
        return point

    def tangent(self, s: float) -> Array:
        """Unit tangent at arc length `s`, shape (3,) in the world."""
        angle = s / self.radius
        tangent: Array = np.sin(angle) * self.across + np.cos(angle) * self.over
        return tangent


@dataclass(frozen=True)
class PathFollower:
    """A hand that moves along a path in a given time and pulls the tool after it.

    The reference runs along the path with a smooth start and end (quintic blends of `ramp` seconds, so that speed,
    acceleration and its change begin at zero); the velocity asked for is the reference's own plus `gain` times how far
    the tool is behind.

    Parameters
    ----------
    path : Path
        The curve.
    speed : float
        Speed between the blends [m/s].
    ramp : float
        Duration of each blend [s].
    gain : float
        Pull per distance [1/s].
    """

    path: Path
    speed: float
    ramp: float
    gain: float

    def __post_init__(self) -> None:
        if not (self.speed > 0.0 and self.ramp > 0.0 and self.gain >= 0.0):
            raise ValueError(
                "path follower: expected positive speed and ramp and a gain that is not negative, "
                f"got {self.speed}, {self.ramp}, {self.gain}"
            )
        if self.path.length < self.speed * self.ramp:
            raise ValueError(
                f"path follower: expected a path of at least speed x ramp = {self.speed * self.ramp:g} m, "
                f"got {self.path.length:g} m"
            )

    @property
    def duration(self) -> float:
        """Time from start to rest [s]."""
        return self.path.length / self.speed + self.ramp

    def progress(self, t: float) -> tuple[float, float]:
        """Arc length [m] and speed [m/s] of the reference at time `t` [s]."""
        blend = self.speed * self.ramp
        if t < self.ramp:
            share, rate = _blend(max(t, 0.0) / self.ramp)
            return blend * share, self.speed * rate
        if t > self.duration - self.ramp:
            share, rate = _blend(max(self.duration - t, 0.0) / self.ramp)
            return self.path.length - blend * share, self.speed * rate
        return blend / 2.0 + self.speed * (t - self.ramp), self.speed

    def twist(self, t: float, pose: Array) -> Array:
        """Twist that the hand asks for.

        Parameters
        ----------
        t : float
            Time since the start [s].
        pose : ndarray, shape (4, 4)
            Where the tool is [m].

        Returns
        -------
        ndarray, shape (6,)
            Linear and angular velocity of the tool centre point, world axes [m/s, rad/s]; the latter zero.
        """
        s, speed = self.progress(t)
        linear = speed * self.path.tangent(s) + self.gain * (self.path.point(s) - pose[:3, 3])
        return np.concatenate([linear, np.zeros(3)])


def _blend(x: float) -> tuple[float, float]:
    """Distance and speed, both as shares, a share `x` into a blend: the speed is the quintic smooth step."""
    speed = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    return x**4 * (2.5 - 3.0 * x + x * x), speed
