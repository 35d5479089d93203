"""Paths from random postures into whatever comes: limits, singularities of guided and locked rows, often at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from ...formulations import Mode
from .singular import RAMP, ramped

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ...robots import Robot

    Array = NDArray[np.float64]

# One of each kind, with arguments that are not axis-aligned.
RANDOM_MODES: Final = (
    *("free", "position", "fix-orientation", "fix-position", "line:z", "plane:1,-2,0.5", "rcm:-0.12"),
)
#: Where the hand turns, it does so at this speed, whatever that of its translation [rad/s].
TURN: Final = 1.5
_LENGTH: Final = 0.45
_TURNING_TIME: Final = 2.0


@dataclass(frozen=True)
class RandomPath:
    """A hand that pulls in one random direction, then back in another, from rest to rest.

    Attributes
    ----------
    name : str
        As listed.
    mode : str
        As in `Mode.parse`.
    q0 : ndarray, shape (nv,)
        Start [rad or m].
    legs : tuple of two ndarrays, shape (6,)
        Directions; their translations and rotations are scaled each to its speed.
    q_max_deg : mapping
        Empty: the robot's own limits hold.
    """

    name: str
    mode: str
    q0: Array
    legs: tuple[Array, Array]
    q_max_deg: Mapping[int, float] = field(default_factory=dict)

    def _leg(self, speed: float) -> float:
        translates = any(row < 3 for row in Mode.parse(self.mode).free_rows)
        return (min(_LENGTH / speed, 3.0) if translates else _TURNING_TIME) + RAMP

    def duration(self, speed: float) -> float:
        """Time from start to rest at a hand speed [s]."""
        return 2.0 * self._leg(speed)

    def twist(self, t: float, speed: float) -> Array:
        """Twist asked for at time `t` [s], shape (6,) along the axes of the mode [m/s, rad/s]."""
        leg = self._leg(speed)
        if t >= 2.0 * leg:
            return np.zeros(6)
        rows = Mode.parse(self.mode).free_rows
        twist: Array = np.zeros(6)
        for part, size in (([row for row in rows if row < 3], speed), ([row for row in rows if row >= 3], TURN)):
            if part:
                direction = self.legs[int(t >= leg)][part]
                twist[part] = size * direction / np.linalg.norm(direction)
        scaled: Array = ramped(t % leg, leg) * twist
        return scaled


def random_paths(robot: Robot, mode: str, count: int, seed: int) -> tuple[RandomPath, ...]:
    """Draw paths from postures within the middle four fifths of the joint ranges.

    Parameters
    ----------
    robot : Robot
    mode : str
    count, seed : int
        The same seed gives the same paths; the first of a larger count are those of a smaller.
    """
    low, high = np.maximum(robot.q_min, -np.pi), np.minimum(robot.q_max, np.pi)
    paths = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        q0 = low + (high - low) * rng.uniform(0.1, 0.9, robot.nv)
        out, aside = rng.normal(size=6), rng.normal(size=6)
        paths.append(RandomPath(f"{mode}, {k}", mode, q0, (out, 0.3 * aside - out)))
    return tuple(paths)
