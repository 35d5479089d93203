"""What self-motion is to improve: the four criteria of the thesis, as a gradient at a state."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..formulations import Tick
    from .situation import Situation

    Array = NDArray[np.float64]


def joint_velocity(at: Situation, qd: Array) -> Array:
    """Descent of 1/2 qd'W qd: -W qd / max W, at the command `qd` of the tasks alone (thesis 3.1.1; Whitney 1969).

    The gradient is one with respect to velocity. Over the largest weight, a gain of 1 never steps beyond the minimum
    along it. With equal weights nothing is left to do: the pseudo-inverse gives the least norm already.
    """
    weight = at.inputs["criterion_weight"]
    return np.asarray(-weight * qd / np.max(weight))


def joint_limits(at: Situation, qd: Array) -> Array:  # noqa: ARG001  # all criteria are called alike
    """Descent of 1/2 (q - q_mid)'W (q - q_mid), joints without limits left out (thesis 3.1.1; Liegeois 1977)."""
    weight = at.inputs["criterion_weight"]
    return np.asarray(-weight * (at.q - at.middle))


def manipulability(at: Situation, qd: Array) -> Array:  # noqa: ARG001  # as above
    r"""Ascent of sqrt(det(J J')), J the locked and the guided rows (thesis 3.1.1; Yoshikawa 1985).

    With singular values and vectors of J it is :math:`\partial h/\partial q_k = \sum_i (\prod_{j \ne i} \sigma_j)\,
    u_i'\,(\partial J/\partial q_k)\,v_i`, which is finite at a singularity too.
    """
    J = np.vstack((at.J_fixed, at.J_free))
    m, nv = J.shape
    if m > nv:
        return np.zeros(nv)  # det(J J') is zero everywhere
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    others = np.array([np.prod(np.delete(sigma, i)) for i in range(m)])
    # Row k of `slope` is dJ/dq_k, column by column of J.
    slope = at.extras["slope"].reshape(nv, nv, m)
    return np.asarray(np.einsum("i,ai,kba,ib->k", others, U, slope, Vt))


def obstacle_distance(at: Situation, qd: Array) -> Array:  # noqa: ARG001  # as above
    """Ascent of the least distance between arm and obstacle (thesis 3.1.1; Khatib 1986).

    The arm is its skeleton: segments between the origins of its joints, and on to the tool centre point; the obstacle
    is a point. At the closest point of the skeleton the distance's gradient is that of the material point there.
    """
    obstacle = at.inputs["obstacle"]
    if not np.isfinite(obstacle).all():
        return np.zeros(at.nv)
    points = at.extras["skeleton"]  # shape (nv + 1, 3)
    slopes = at.extras["skeleton slope"].reshape(len(points), 3, at.nv)
    starts, along = points[:-1], np.diff(points, axis=0)
    lengths = np.maximum(np.sum(along * along, axis=1), 1e-18)
    share = np.clip(np.sum((obstacle - starts) * along, axis=1) / lengths, 0.0, 1.0)
    away = starts + share[:, None] * along - obstacle
    distance = np.linalg.norm(away, axis=1)
    i = int(np.argmin(distance))
    if not distance[i] > 0.0:
        return np.zeros(at.nv)  # inside the arm no direction leads out
    slope = (1.0 - share[i]) * slopes[i] + share[i] * slopes[i + 1]
    return np.asarray(slope.T @ away[i] / distance[i])


CRITERIA: Final[dict[str, Callable[[Situation, Array], Array]]] = {
    "joint-limits": joint_limits,
    "joint-velocity": joint_velocity,
    "manipulability": manipulability,
    "obstacle-distance": obstacle_distance,
}


def criterion_ingredients(criterion: str, tick: Tick) -> dict[str, ca.SX]:
    """What a criterion needs of the tick."""
    if criterion in ("joint-limits", "joint-velocity"):
        _ = tick.parameter("criterion_weight", 1.0, size=tick.nv, lowest=0.0, positive=True)
    if criterion == "joint-limits":
        _ = tick.q_min, tick.q_max
    if criterion == "manipulability":
        J = ca.vertcat(tick.J_fixed, tick.J_free)
        return {"slope": ca.jacobian(ca.vec(J), tick.q).T}
    if criterion == "obstacle-distance":
        _ = tick.parameter("obstacle", np.inf, size=3, may_be_infinite=True, unit="m")
        origins = [tick.kinematics.point_on_link(link, (0.0, 0.0, 0.0)) for link in range(1, tick.nv + 1)]
        skeleton = ca.horzcat(*origins, tick.pose[:3, 3])
        return {"skeleton": skeleton.T, "skeleton slope": ca.jacobian(ca.vec(skeleton), tick.q)}
    return {}
