"""What the report prints, put to the test with the arm's own kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import document

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ...robots import Robot

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Checks:
    """Findings; lengths in millimetres, as the report has them.

    Attributes
    ----------
    initial : ndarray, shape (3,)
        Where the printed start puts the tool; the report prints the same.
    outside : tuple of str
        Joints of the printed start that are beyond their bounds.
    final_radians, final_degrees : ndarray, shape (3,)
        Where the printed final parameters put the tool, angles read as either.
    final_distance : float
        Between the printed final position and the nearer of these two.
    final_rounded : float
        Between the printed final position and the nearest that the parameters can mean, angles in radians, the last
        digit of each free within its rounding.
    error : float
        Sum of absolute differences between the printed final and desired positions.
    ranges : tuple of bool
        Which printed final parameters are within the bounds, angles in radians less whole turns.
    ranges_known : tuple of bool
        Of which the printed digits settle that.
    """

    initial: Array
    outside: tuple[str, ...]
    final_radians: Array
    final_degrees: Array
    final_distance: float
    final_rounded: float
    error: float
    ranges: tuple[bool, ...]
    ranges_known: tuple[bool, ...]


def check_document(robot: Robot) -> Checks:
    """Test the printed figures of question 3."""
    from scipy.optimize import least_squares  # here, because it takes half a second to import

    def tool(parameters: ArrayLike) -> Array:
        return 1e3 * robot.pose(to_si(parameters))[:3, 3]

    start = to_si(document.START)
    outside = (start < robot.q_min) | (start > robot.q_max)
    printed = np.array(document.PRINTED_PARAMETERS)
    radians = tool(printed)
    degrees = tool(np.where(_angular(robot), np.deg2rad(printed), printed))
    final = np.array(document.PRINTED_FINAL)
    rounding = np.array(document.PRINTED_ROUNDING)
    trials = np.random.default_rng(0).uniform(-0.95, 0.95, (4, robot.nv))
    nearest = np.inf
    for trial in trials:
        found = least_squares(lambda x: tool(printed + x * rounding) - final, trial, bounds=(-1, 1), max_nfev=60)
        nearest = min(nearest, float(np.linalg.norm(found.fun)))
    low, high = (to_printed(limit) for limit in (robot.q_min, robot.q_max))
    verdicts = []
    for shift in (0.0, -1.0, 1.0):
        value = printed + shift * rounding
        turned = np.where(_angular(robot), low + np.mod(value - low, 2.0 * np.pi), value)
        verdicts.append((turned >= low) & (turned <= high))
    wide = rounding < np.where(_angular(robot), 0.1, np.inf)
    known = wide & (verdicts[0] == verdicts[1]) & (verdicts[0] == verdicts[2])
    return Checks(
        initial=tool(document.START),
        outside=tuple(np.array(robot.joint_names)[outside].tolist()),
        final_radians=radians,
        final_degrees=degrees,
        final_distance=float(min(np.linalg.norm(radians - final), np.linalg.norm(degrees - final))),
        final_rounded=nearest,
        error=float(np.abs(final - document.TARGET).sum()),
        ranges=tuple(verdicts[0].tolist()),
        ranges_known=tuple(known.tolist()),
    )


def to_si(parameters: ArrayLike) -> Array:
    """Joint positions as the report's code takes them (rad, mm) in SI, shape (5,)."""
    return np.asarray(parameters, dtype=float) * [1.0, 1e-3, 1.0, 1.0, 1.0]


def to_printed(q: ArrayLike) -> Array:
    """The opposite of `to_si`."""
    return np.asarray(q, dtype=float) * [1.0, 1e3, 1.0, 1.0, 1.0]


def _angular(robot: Robot) -> NDArray[np.bool_]:
    return np.array([not name.startswith("d") for name in robot.joint_names])
