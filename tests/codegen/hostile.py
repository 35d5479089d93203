"""Ticks of any bits for `bits_driver.c`, on arms of any size: singular, on limits, far out, not finite."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from tests.codegen.compiled import SPEEDS, near

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinqp.robots import Robot

    Array = NDArray[np.float64]

#: Hand velocities beyond what any hand has, which a broken sensor may say all the same [m/s, rad/s].
_HUGE: Final = (1e3, 1e8, 1e16, 1e155, 1e300)
#: Numbers at the ends of what a double can be, and those that are none.
_ENDS: Final = (np.nan, np.inf, -np.inf, 0.0, -0.0, 5e-324, -5e-324, 1e-300, 1.8e308, -1e22, 1e15, -1.0)
_CHANGES: Final = 2


def hostile_rows(robot: Robot, modes: int, entries: int, count: int, seed: int) -> Array:
    """Draw rows for the driver.

    Parameters
    ----------
    robot : Robot
    modes : int
        Modes of the library; a few rows name others.
    entries : int
        Doubles of the input, the joint positions first.
    count, seed : int
        Number of rows; of the random numbers.

    Returns
    -------
    ndarray, shape (count, 7 + entries)
    """
    rng = np.random.default_rng(seed)
    low, high = np.maximum(robot.q_min, -np.pi), np.minimum(robot.q_max, np.pi)
    rows = []
    for index in range(count):
        q = near(low, high, rng) if index % 3 else robot.random_configuration(rng)
        if index % 7 == 0:
            q = np.zeros(robot.nv) if index % 2 else q * 10.0 ** rng.uniform(-12, -3)
        rest = rng.normal(size=entries - robot.nv) * rng.choice(SPEEDS)
        if index % 5 == 0:
            rest *= rng.choice([0.0, *_HUGE])
        values = np.concatenate([q, rest])
        if index % 11 == 0:
            values[rng.integers(entries, size=1 + index % 3)] = rng.choice(_ENDS)
        if index % 37 == 0:
            values = rng.integers(0, 2**64, size=entries, dtype=np.uint64).view(np.float64)
        places, changes = np.full(_CHANGES, -1.0), np.zeros(_CHANGES)
        if index % 4 == 0:
            places = rng.integers(-1, 4096, size=_CHANGES).astype(float)
            changes = np.where(rng.random(_CHANGES) < 0.5, rng.choice(_ENDS, _CHANGES), 10.0 ** rng.uniform(-6, 6))
        mode = rng.integers(modes) if index % 101 else rng.choice([-1, modes, 2**30])
        rows.append([mode, rng.choice([-1, -1, -1, 0, 1, 2, 5]), rng.integers(2), *places, *changes, *values])
    return np.array(rows)
