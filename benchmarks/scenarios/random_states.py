"""`random-states`: states near joint limits that have nothing to do with each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ...formulations import DEFAULT_DT, Mode
from ...robots import load_robot
from .base import Scenario, States

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...robots import Robot

    Array = NDArray[np.float64]

# Share of joints near a limit, and how near: log-uniform between these distances [rad].
NEAR_SHARE: Final = 0.4
NEAR: Final = (1e-7, 3e-2)
FASTEST: Final = 0.25


def random_states(seed: int = 0, count: int = 600) -> Scenario:
    """Draw states near joint limits, with hands that pull in any direction.

    Each joint is, independently, near one of its limits (`NEAR_SHARE`, at a distance log-uniform in `NEAR`) or anywhere
    in its range. The hand's velocity has any direction and up to `FASTEST` m/s. The last command is a share of what
    the joint could have stopped from in time, so that formulations at acceleration level get states that can occur.
    A warm start is worth little here: it is what they are compared with.

    Parameters
    ----------
    seed : int
        Of the draw; not negative.
    count : int
        How many.
    """
    if count < 1 or seed < 0:
        raise ValueError(
            f"random-states: expected a count of at least 1 and a seed of at least 0, got {count} and {seed}"
        )
    robot = load_robot("lbr_med14")
    mode = Mode.fix_orientation()
    rng = np.random.default_rng(seed)
    shape = (count, robot.nv)
    q = robot.q_min + (robot.q_max - robot.q_min) * rng.random(shape)
    nearest, furthest = np.log(NEAR)
    distance = np.exp(nearest + (furthest - nearest) * rng.random(shape))
    near, low = rng.random(shape) < NEAR_SHARE, rng.random(shape) < 0.5
    q = np.where(near, np.where(low, robot.q_min + distance, robot.q_max - distance), q)
    v = rng.normal(size=(count, mode.m_free))
    v *= rng.uniform(0.0, FASTEST, size=(count, 1)) / np.linalg.norm(v, axis=1, keepdims=True)
    down, up = _fastest(q - robot.q_min, robot), _fastest(robot.q_max - q, robot)
    qd_prev = (down + up) * rng.random(shape) - down
    return Scenario(
        name="random-states",
        description="i.i.d. states near joint limits, seeded; orientation fixed",
        robot=robot,
        q0=q[0],
        dt=DEFAULT_DT,
        states=States(mode, q, qd_prev, v),
    )


def _fastest(distance: Array, robot: Robot) -> Array:
    """Velocity at which a joint can still stop within `distance`, in sampled time; `viable_bound` in numbers."""
    step = robot.qdd_max * DEFAULT_DT
    delta = distance / (step * DEFAULT_DT)
    m = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * delta) - 1.0))
    fastest: Array = np.minimum(step * (0.5 * m + delta / (m + 1.0)), robot.qd_max)
    return fastest
