"""Self-motion towards a posture: of all joint positions with the same tool pose, the nearest one to another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..robots import finite_vector
from ..solvers import QP, Status, solve
from .ik_result import IkStatus

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from .inverse_kinematics import InverseKinematics

    Array = NDArray[np.float64]

# A step that promises less than this share of a joint's range, as a norm, is none.
_STILL: Final = 1e-5
_SMALLEST_TRUST: Final = 1e-3
# Steps to get the tool back to where it was; a step from which that takes longer was too long.
_BACK: Final = 8


def relax(ik: InverseKinematics, q: ArrayLike, posture: ArrayLike, *, max_steps: int = 50) -> tuple[Array, int]:
    """Move within the limits, the tool where it is, as near to a posture as goes without getting farther first.

    Every step is a QP along the linearised self-motion, followed by inverse kinematics back to the tool's pose; a
    step is kept if that gets there and the posture is nearer, and the next ones are shorter if not.

    Parameters
    ----------
    ik : InverseKinematics
        For its robot, and for its mode: what counts as the tool being where it is.
    q : array_like, shape (nv,)
        Start, within the limits [rad or m].
    posture : array_like, shape (nv,)
        Joint positions; distances to it are counted in shares of the joints' ranges [rad or m].
    max_steps : int
        At most.

    Returns
    -------
    q : ndarray, shape (nv,)
        Tool pose as at the start, to the tolerance of `ik` [rad or m].
    steps : int
        QPs solved.

    Raises
    ------
    ValueError
        When an input has the wrong shape or is not finite.
    """
    robot = ik.robot
    here, wish = finite_vector("q", q, robot.nv), finite_vector("posture", posture, robot.nv)
    spans = robot.q_max - robot.q_min
    spans = np.where(np.isfinite(spans), spans, 2.0 * np.pi)
    weight = 1.0 / spans**2
    pose = robot.pose(here)
    rows = 3 if ik.position_only else 6
    trust, steps = 0.25, 0
    for _ in range(max_steps):
        if trust < _SMALLEST_TRUST:
            break
        jacobian = robot.jacobian(here)[:rows]
        qp = QP(
            H=np.diag(weight * spans**2),
            g=weight * (here - wish) * spans,
            A=jacobian * spans,
            b=np.zeros(rows),
            lb=np.maximum((robot.q_min - here) / spans, -trust).clip(max=0.0),
            ub=np.minimum((robot.q_max - here) / spans, trust).clip(min=0.0),
            x_feasible=np.zeros(robot.nv),
        )
        solution = solve(qp)
        steps += 1
        if solution.status is not Status.SOLVED or np.linalg.norm(solution.x) < _STILL:
            break
        back = ik(pose, here + spans * solution.x, only=True, max_steps=_BACK)
        steps += back.total_steps
        nearer = weight @ (back.q - wish) ** 2 < weight @ (here - wish) ** 2
        if back.status is IkStatus.REACHED and nearer:
            here, trust = back.q, min(2.0 * trust, 1.0)
        else:
            trust *= 0.25
    return here, steps
