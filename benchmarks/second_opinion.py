"""How near to a point an arm can get, by another method: bounded least squares from many starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..robots import Robot

    Array = NDArray[np.float64]


def nearest_distances(robot: Robot, targets: ArrayLike, *, starts: int = 12, seed: int = 1) -> Array:
    """Smallest distance of the tool centre point from each target that scipy's `least_squares` finds.

    It shares nothing with `kinqp.control.InverseKinematics` but the kinematics: trust-region reflective, a method that
    stays strictly within the limits, from starts spread over the joint ranges (a Halton sequence).

    Parameters
    ----------
    robot : Robot
        With position limits on every joint.
    targets : array_like, shape (N, 3)
        [m].
    starts : int
        For each target.
    seed : int
        Of the starts.

    Returns
    -------
    ndarray, shape (N,)
        [m].

    Raises
    ------
    ValueError
        When a joint has no limits, or the targets have the wrong shape.
    """
    from scipy.optimize import least_squares  # here, because both take half a second to import
    from scipy.stats import qmc

    points = np.asarray(targets, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"targets: expected shape (N, 3), got {points.shape}")
    span = robot.q_max - robot.q_min
    if not np.isfinite(span).all():
        raise ValueError("robot: expected position limits on every joint")
    drawn = qmc.Halton(robot.nv, rng=np.random.default_rng(seed)).random(starts)

    def remaining(share: Array, point: Array) -> Array:
        # In millimetres: its tolerances then mean something.
        missing: Array = 1e3 * (robot.pose(robot.q_min + share * span)[:3, 3] - point)
        return missing

    def slope(share: Array, point: Array) -> Array:  # noqa: ARG001  # called with the same arguments as the function
        jacobian: Array = 1e3 * robot.jacobian(robot.q_min + share * span)[:3] * span
        return jacobian

    nearest = np.full(len(points), np.inf)
    for number, point in enumerate(points):
        for start in drawn:
            found = least_squares(
                remaining, start, slope, args=(point,), bounds=(0.0, 1.0), xtol=1e-12, ftol=1e-12, gtol=1e-12
            )
            nearest[number] = min(nearest[number], 1e-3 * float(np.linalg.norm(found.fun)))
    return nearest
