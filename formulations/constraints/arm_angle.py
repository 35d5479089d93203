"""The arm angle of an arm with shoulder, elbow and wrist centres: the angle of its self-motion.

Source: Kreutz-Delgado, Long, Seraji, "Kinematic analysis of 7-DOF manipulators", International Journal of Robotics
Research 11(5), 1992: the angle of the plane through shoulder, elbow and wrist from the plane through shoulder, wrist
and a reference direction, about the line from shoulder to wrist.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
import pinocchio as pin

from ...robots import RobotError
from ..algebra import dot, matmul

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...robots import Robot, SymbolicKinematics

    Array = NDArray[np.float64]

# Axes meet if they pass a common point this closely, in two postures [m].
_MEET = 1e-9
# Below this length a vector's direction fades to zero [m, or 1].
_FADE = 1e-9
_JOINTS = 7


@dataclass(frozen=True)
class Centres:
    """Shoulder, elbow and wrist: each a point of a link, in the link's frame [m].

    Attributes
    ----------
    shoulder, elbow, wrist : tuple of int and ndarray of shape (3,)
        Link, counted as in `SymbolicKinematics.point_on_link`, and the point in its frame.
    """

    shoulder: tuple[int, Array]
    elbow: tuple[int, Array]
    wrist: tuple[int, Array]


@dataclass(frozen=True)
class ArmAngle:
    """The arm angle and its rate.

    Attributes
    ----------
    sine, cosine : ca.SX, shape (1, 1)
        Of the angle, times a common positive factor; both zero where the angle is undefined.
    row : ca.SX, shape (1, nv)
        `row` @ qd is the angle's rate times `scale`.
    scale : ca.SX, shape (1, 1)
        Distance of the elbow from the line through shoulder and wrist, times the sine of the angle between that line
        and the reference direction [m]. Zero where the angle is undefined, and there the row is zero too.
    offset : ca.SX, shape (1, 1)
        Distance of the elbow from the line through shoulder and wrist [m].
    offset_row : ca.SX, shape (1, nv)
        `offset_row` @ qd is its rate.
    """

    sine: ca.SX
    cosine: ca.SX
    row: ca.SX
    scale: ca.SX
    offset: ca.SX
    offset_row: ca.SX


def find_centres(robot: Robot) -> Centres:
    """Find where the axes of an S-R-S arm meet: 1, 2, 3 in the shoulder, 3, 4, 5 in the elbow, 5, 6, 7 in the wrist.

    Raises
    ------
    RobotError
        When the arm is not one of seven revolute joints whose axes meet so.
    """
    expected = f"arm angle of {robot.name}: expected seven revolute joints whose axes meet in shoulder, elbow and wrist"
    if robot.nv != _JOINTS:
        raise RobotError(f"{expected}, got {robot.nv} joints")
    rng = np.random.default_rng(0)
    postures = [rng.uniform(-1.0, 1.0, _JOINTS) for _ in range(2)]
    # Each centre is a fixed point of the link before its middle axis, and, lying on the axis before, of one link less.
    found = []
    for label, first in (("shoulder", 0), ("elbow", 2), ("wrist", 4)):
        locals_ = []
        for q in postures:
            frames, axes = _axes(robot, q)
            point, distance = _meeting_point([axes[i] for i in range(first, first + 3)])
            if distance > _MEET:
                raise RobotError(
                    f"{expected}, got axes {first + 1} to {first + 3} that pass the {label} by {distance:.1e} m"
                )
            locals_.append(frames[first].actInv(point))
        if np.abs(locals_[0] - locals_[1]).max() > _MEET:
            raise RobotError(f"{expected}, got a {label} that is no fixed point of link {first}")
        found.append((first, np.asarray(locals_[0], dtype=np.float64)))
    return Centres(*found)


def _axes(robot: Robot, q: Array) -> tuple[list[Any], list[tuple[Array, Array]]]:
    """Frames of the links, base first, and the joints' axes as (point, direction), in the base frame."""
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, robot.to_pinocchio(q))
    axes = []
    for i in range(1, _JOINTS + 1):
        column = pin.getJointJacobian(robot.model, data, i, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:, i - 1]
        if not np.any(column[3:]):
            raise RobotError(f"arm angle of {robot.name}: expected revolute joints, got {robot.joint_names[i - 1]!r}")
        axes.append((np.array(data.oMi[i].translation), np.array(column[3:])))
    return [pin.SE3.Identity(), *(data.oMi[i].copy() for i in range(1, _JOINTS + 1))], axes


def _meeting_point(axes: list[tuple[Array, Array]]) -> tuple[Array, float]:
    """Point closest to lines, in least squares, and its distance from the farthest [m]."""
    projectors = [np.eye(3) - np.outer(direction, direction) for _, direction in axes]
    offsets = [projector @ point for projector, (point, _) in zip(projectors, axes, strict=True)]
    meeting = np.linalg.lstsq(np.vstack(projectors), np.hstack(offsets), rcond=None)[0]
    distance = max(float(np.linalg.norm(P @ meeting - o)) for P, o in zip(projectors, offsets, strict=True))
    return meeting, distance


def arm_angle(kinematics: SymbolicKinematics, centres: Centres, reference: ca.SX) -> ArmAngle:
    """Express the arm angle.

    Parameters
    ----------
    kinematics : SymbolicKinematics
        Of the arm.
    centres : Centres
        From `find_centres`.
    reference : ca.SX, shape (3, 1)
        Unit vector from which the angle counts, world axes.
    """
    (_, S), (e_link, E), (w_link, W) = (
        (link, kinematics.point_on_link(link, [float(x) for x in point]))
        for link, point in (centres.shoulder, centres.elbow, centres.wrist)
    )
    elbow, wrist = E - S, W - S
    line = _faded(wrist)
    side = elbow - line * dot(line, elbow)  # from the line to the elbow
    upright = reference - line * dot(line, reference)
    off_line, slope = ca.sqrt(dot(side, side)), ca.sqrt(dot(upright, upright))
    swing = ca.cross(line, _faded(side))  # where the elbow goes as the angle grows
    turn = ca.cross(line, _faded(upright))
    J_elbow, J_wrist = kinematics.point_jacobian(e_link, E), kinematics.point_jacobian(w_link, W)
    lever = dot(line, elbow) * _faded_reciprocal(wrist)
    J_side = J_elbow - lever * J_wrist  # the elbow's velocity less the line's
    row = slope * matmul(swing.T, J_side)
    row += off_line * dot(line, reference) * _faded_reciprocal(wrist) * matmul(turn.T, J_wrist)
    # A row that is nothing but rounding would hold the arm in a random direction.
    exists = ca.logic_and(off_line > _FADE, slope > _FADE)
    row = ca.sparsify(ca.if_else(exists, row, 0))
    return ArmAngle(
        sine=dot(ca.cross(reference, side), line),
        cosine=dot(reference, side),
        row=row,
        scale=ca.if_else(exists, off_line * slope, 0),
        offset=off_line,
        offset_row=ca.sparsify(ca.if_else(off_line > _FADE, matmul(_faded(side).T, J_side), 0)),
    )


def _faded_reciprocal(vector: ca.SX) -> ca.SX:
    return 1 / ca.sqrt(dot(vector, vector) + _FADE**2)


def _faded(vector: ca.SX) -> ca.SX:
    """Direction of a vector that fades to zero where it has none, and is exact to rounding elsewhere."""
    return vector * _faded_reciprocal(vector)
