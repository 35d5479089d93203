"""Joint positions along a row of targets, each next to the one before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..robots import finite_vector, real_array
from .ik_result import IkStatus
from .posture import relax

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from .ik_result import IkResult
    from .inverse_kinematics import InverseKinematics

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class PointPath:
    """Solutions along N targets.

    Attributes
    ----------
    targets : ndarray, shape (N, 3) or (N, 4, 4)
        As given [m].
    q : ndarray, shape (N, nv)
        Joint positions, within the limits [rad or m].
    position : ndarray, shape (N, 3)
        Where the tool centre point gets [m].
    error, angle : ndarray, shape (N,)
        As in `IkResult` [m, rad].
    status : tuple of IkStatus
    steps : int
        QPs solved for all of it.
    """

    targets: Array
    q: Array
    position: Array
    error: Array
    angle: Array
    status: tuple[IkStatus, ...]
    steps: int

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Which targets were reached, shape (N,)."""
        return np.array([status is IkStatus.REACHED for status in self.status])


def solve_points(
    ik: InverseKinematics,
    targets: ArrayLike,
    q0: ArrayLike,
    *,
    posture: ArrayLike | None = None,
    on_point: Callable[[int, int], None] | None = None,
) -> PointPath:
    """Solve the targets one after the other, each from the solution before.

    Of all joint positions with the same tool point the one nearest to `posture` is taken (`relax`), so that solutions
    depend on the target and not on the way there: greedily taking the nearest to the last solution runs into corners of
    the joint ranges from which the next target is out of reach. Where another start ends nearer to a target than the
    neighbour does, that point is gone to from the neighbour again, if there is a way.

    Parameters
    ----------
    ik : InverseKinematics
    targets : array_like, shape (N, 3) or (N, 4, 4)
        Positions [m] or homogeneous poses.
    q0 : array_like, shape (nv,)
        Start for the first target [rad or m].
    posture : array_like, shape (nv,), optional
        Joint positions to stay near to [rad or m]; if left out the middle of the ranges, `q0` for joints without.
    on_point : callable, optional
        Called with (targets done, targets in all) after every one.

    Returns
    -------
    PointPath

    Raises
    ------
    ValueError
        When an input has the wrong shape or is not finite.
    """
    given = real_array("targets", targets)
    if given.ndim not in (2, 3) or len(given) == 0:
        raise ValueError(f"targets: expected shape (N, 3) or (N, 4, 4), got {given.shape}")
    q = finite_vector("q0", q0, ik.robot.nv)
    if posture is None:
        limited = np.isfinite(ik.robot.q_min) & np.isfinite(ik.robot.q_max)
        low, high = np.where(limited, ik.robot.q_min, q), np.where(limited, ik.robot.q_max, q)
        posture = 0.5 * (low + high)
    results: list[IkResult] = []
    solutions: list[Array] = []
    steps = 0
    for number, target in enumerate(given):
        result = ik(target, q)
        steps += result.total_steps
        q = result.q
        if number > 0 and result.start > 0:
            again = ik(ik.robot.pose(q), solutions[-1], only=True)
            steps += again.total_steps
            q = again.q if again.status is IkStatus.REACHED else q
        q, more = relax(ik, q, posture)
        steps += more
        results.append(result)
        solutions.append(q)
        if on_point is not None:
            on_point(number + 1, len(given))
    return PointPath(
        targets=given,
        q=np.array(solutions),
        position=np.array([ik.robot.pose(q)[:3, 3] for q in solutions]),
        error=np.array([result.error for result in results]),
        angle=np.array([result.angle for result in results]),
        status=tuple(result.status for result in results),
        steps=steps,
    )
