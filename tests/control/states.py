"""States for the invariants: ordinary, on limits, beyond them, and singular."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kinqp.robots import Robot

Array = NDArray[np.float64]


def states(robot: Robot, count: int, seed: int = 0) -> Iterator[tuple[str, Array]]:
    """Yield (kind, q): the kinds in turn, `count` in all."""
    rng = np.random.default_rng(seed)
    low = np.where(np.isfinite(robot.q_min), robot.q_min, -np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, np.pi)
    for index in range(count):
        q = rng.uniform(low, high)
        kind = ("inside", "on limits", "beyond limits", "zero", "near zero", "most on limits")[index % 6]
        if kind == "on limits":
            joints = rng.choice(robot.nv, size=2, replace=False)
            q[joints] = np.where(rng.random(2) < 0.5, low[joints], high[joints])
        elif kind == "beyond limits":
            q += 0.1 * rng.choice([-1.0, 1.0], robot.nv) * (high - low)
        elif kind == "zero":
            q = np.zeros(robot.nv)
        elif kind == "near zero":
            q *= 1e-6
        elif kind == "most on limits":
            q = np.where(rng.random(robot.nv) < 0.7, high, q)
        yield kind, q
