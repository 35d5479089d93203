"""Stands in for `kinqp.control.GuidedRun` until that is there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...robots import Robot
    from ...solvers import Status

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class GuidedRun:
    """As in the contract of `simulate_guiding`."""

    t: Array
    q: Array
    qd: Array
    position: Array
    rotation: Array
    wrench: Array
    twist: Array
    v: Array
    v_actual: Array
    status: tuple[Status, ...]
    mode: tuple[str, ...]
    phase: tuple[str, ...]
    active: tuple[tuple[str, ...], ...]
    iterations: NDArray[np.int64]
    drift: Array
    yielded: NDArray[np.bool_]
    dt: float
    robot: Robot
    q_end: Array

    def acceleration(self) -> Array:
        """Joint accelerations by differences of the commands, from rest, shape (N, nv) [rad/s^2]."""
        acceleration: Array = np.diff(self.qd, axis=0, prepend=0.0) / self.dt
        return acceleration
