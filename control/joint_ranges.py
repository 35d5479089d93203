"""What inverse kinematics takes from the joints' ranges: how far one step may go, and where else to start."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..robots.chain import joint_axis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..robots import Robot

    Array = NDArray[np.float64]

# Largest step of a joint that turns: beyond a quarter of a turn the linearised kinematics say nothing [rad].
_LARGEST_TURN: Final = 1.5


def largest_steps(robot: Robot) -> Array:
    """Give the largest step of each joint: half of its range, and no more than 1.5 rad of a joint that turns.

    A joint that slides may go far at once, since the kinematics are linear in it.

    Parameters
    ----------
    robot : Robot
        Only its position limits count.

    Returns
    -------
    ndarray, shape (nv,)
        Positive and finite [rad or m].
    """
    half = 0.5 * (robot.q_max - robot.q_min)
    # A joint without a range, because it may not move or because it may go anywhere, gets a step all the same.
    half = np.where((half > 0.0) & np.isfinite(half), half, _LARGEST_TURN)
    slides = np.array([joint_axis(joint)[0] for joint in list(robot.model.joints)[1:]])
    return np.where(slides, half, np.minimum(half, _LARGEST_TURN))


def spread_starts(robot: Robot, count: int, seed: int) -> Array:
    """Spread starts evenly over the joint ranges, a full turn for joints without limits.

    Parameters
    ----------
    robot : Robot
    count : int
        How many.
    seed : int
        Same seed, same starts.

    Returns
    -------
    ndarray, shape (count, nv)
        [rad or m].
    """
    from scipy.stats import qmc  # here, because it takes half a second to import

    low = np.where(np.isfinite(robot.q_min), robot.q_min, -np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, np.pi)
    drawn: Array = qmc.Halton(robot.nv, rng=np.random.default_rng(seed)).random(count)
    spread: Array = low + drawn * (high - low)
    return spread
