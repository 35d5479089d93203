"""A spiral about the world's z axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class SpiralPath:
    r"""A helix: x = x_c + r cos(phi), y = y_c + r sin(phi), z = z_c + rise phi.

    Source of the form: N. Adaloglou, "Project Medical Robotics", 2017/2018, question 4, with phi = 2 pi t / T.

    Parameters
    ----------
    centre : tuple of 3 float
        A point of the axis, at the height where phi = 0 [m].
    radius : float
        [m].
    rise : float
        Along z per radian [m/rad]; negative to go down.
    begin, end : float
        First and last phi, in this order [rad].
    """

    centre: tuple[float, float, float]
    radius: float
    rise: float
    begin: float
    end: float

    def __post_init__(self) -> None:
        if not np.isfinite([*self.centre, self.radius, self.rise, self.begin, self.end]).all():
            raise ValueError(f"spiral: expected finite numbers, got {self}")
        if not (self.radius > 0.0 and self.end > self.begin):
            raise ValueError(
                f"spiral: expected a positive radius and begin < end, got {self.radius}, {self.begin}, {self.end}"
            )

    @property
    def length(self) -> float:
        """Arc length of the whole [m]."""
        return self._rate * (self.end - self.begin)

    def point(self, s: float) -> Array:
        """Position at arc length `s`, shape (3,) in the world [m]."""
        point: Array = self._points(np.array([self.begin + s / self._rate]))[0]
        return point

    def tangent(self, s: float) -> Array:
        """Unit tangent at arc length `s`, shape (3,) in the world."""
        phi = self.begin + s / self._rate
        return np.array([-self.radius * np.sin(phi), self.radius * np.cos(phi), self.rise]) / self._rate

    def points(self, count: int) -> Array:
        """`count` points at equal distances along the spiral, both ends among them, shape (count, 3) [m]."""
        if count < 2:
            raise ValueError(f"count: expected at least 2 points, got {count}")
        return self._points(np.linspace(self.begin, self.end, count))

    @property
    def _rate(self) -> float:
        """Arc length per radian [m/rad]."""
        return float(np.hypot(self.radius, self.rise))

    def _points(self, phi: Array) -> Array:
        x, y, z = self.centre
        return np.column_stack([x + self.radius * np.cos(phi), y + self.radius * np.sin(phi), z + self.rise * phi])
