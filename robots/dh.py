"""
A robot from a table of standard Denavit-Hartenberg rows.

Row i takes frame i - 1 to frame i by A_i = Rz(theta) Tz(d) Tx(a) Rx(alpha); a revolute joint adds its
position to theta, a prismatic one to d. Source: Siciliano et al., "Robotics", Springer 2009, section 2.8.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pinocchio as pin

from .assembly import robot_from_model
from .errors import RobotError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from .robot import Robot


@dataclass(frozen=True, kw_only=True)
class DhRow:
    """
    One joint in standard DH convention.

    Parameters
    ----------
    name
        Name of the joint.
    kind
        `"revolute"` or `"prismatic"`.
    theta, d
        Constant parts of the angle about and the offset along the previous z axis [rad, m].
    a, alpha
        Offset along and angle about the new x axis [m, rad].
    q_min, q_max
        Position limits [rad or m].
    qd_max
        Velocity limit [rad/s or m/s].
    tau_max
        Limit of the joint force [Nm or N]; inf where none is known.
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    theta: float = 0.0
    d: float = 0.0
    a: float = 0.0
    alpha: float = 0.0
    q_min: float
    q_max: float
    qd_max: float
    tau_max: float = math.inf


def robot_from_dh(name: str, rows: Sequence[DhRow], *, tip: str = "tool", qdd_max: ArrayLike | None = None) -> Robot:
    """
    Build a robot without inertias from DH rows.

    Parameters
    ----------
    name
        Name of the robot.
    rows
        One for each joint, base first.
    tip
        Name for the frame after the last row, the tool centre point.
    qdd_max
        Acceleration limits, one for all joints or one each [rad/s^2 or m/s^2]; None for this project's
        defaults.

    Returns
    -------
    The robot; the first row starts from its base frame.

    Raises
    ------
    RobotError
        If there are no rows, names repeat, or a row's kind or limits make no sense.
    ValueError
        If `qdd_max` does not fit.
    """
    if not rows:
        raise RobotError("rows: expected at least one DH row, got none between base and tip")
    if len({row.name for row in rows}) != len(rows):
        raise RobotError(f"rows: expected different joint names, got {', '.join(row.name for row in rows)}")
    model = pin.Model()
    model.name = name
    joint, after_joint = 0, pin.SE3.Identity()
    for row in rows:
        _check(row)
        before, moving, after = _placements(row)
        joint = model.addJoint(
            joint,
            moving,
            after_joint * before,
            row.name,
            np.array([row.tau_max]),
            np.array([row.qd_max]),
            np.array([row.q_min]),
            np.array([row.q_max]),
        )
        model.addJointFrame(joint)
        after_joint = after
    model.addFrame(pin.Frame(tip, joint, model.getFrameId(rows[-1].name), after_joint, pin.FrameType.BODY))
    return robot_from_model(name, tip, model, qdd_max)


def _placements(row: DhRow) -> tuple[Any, Any, Any]:
    """Return what comes before the joint's motion, the joint, and what comes after it."""
    turn = pin.SE3(pin.utils.rotate("z", row.theta), np.zeros(3))
    rise = pin.SE3(np.eye(3), np.array([0.0, 0.0, row.d]))
    twist = pin.SE3(pin.utils.rotate("x", row.alpha), np.array([row.a, 0.0, 0.0]))
    joint = pin.JointModelRZ() if row.kind == "revolute" else pin.JointModelPZ()
    return turn * rise, joint, twist


def _check(row: DhRow) -> None:
    if row.kind not in ("revolute", "prismatic"):
        raise RobotError(f"joint {row.name!r}: expected kind 'revolute' or 'prismatic', got {row.kind!r}")
    if not all(math.isfinite(value) for value in (row.theta, row.d, row.a, row.alpha)):
        raise RobotError(f"joint {row.name!r}: expected finite DH parameters, got {row}")
    if not -math.inf < row.q_min < row.q_max < math.inf:
        raise RobotError(f"joint {row.name!r}: expected finite limits q_min < q_max, got {row.q_min} and {row.q_max}")
    if not 0.0 < row.qd_max < math.inf or not row.tau_max > 0.0:
        raise RobotError(
            f"joint {row.name!r}: expected positive limits, got qd_max={row.qd_max} and tau_max={row.tau_max}"
        )
