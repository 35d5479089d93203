"""A robot with a tool on its flange."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from .checks import real_array
from .errors import RobotError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .robot import Robot

# A rotation as written by hand or read from a file is orthonormal to this.
_ORTHONORMAL = 1e-6


def with_tool(robot: Robot, name: str, pose: ArrayLike, *, tip: str = "tool_tip") -> Robot:
    """
    Return the robot with its tool centre point moved to the tip of a tool that is fixed to it.

    The tool has no mass here and no volume: inertias are the bare arm's, and whoever wants it kept off the links gives
    its capsule to `SelfCollision`.

    Parameters
    ----------
    robot
        The bare arm; it stays as it is.
    name
        Name of the arm with its tool. Another name than the arm's, as ready-made capsules go by name and don't hold
        the tool.
    pose
        Shape (3,): the new tool centre point in the frame of the old one, axes kept [m]; or shape (4, 4), its
        homogeneous pose.
    tip
        Name of the new frame.

    Returns
    -------
    The robot with the tool.

    Raises
    ------
    RobotError
        If the pose is not one, a name is empty or taken, or the robot's name is the bare arm's.
    """
    placement = _placement(pose)
    if not name or name == robot.name:
        raise RobotError(f"name of {robot.name} with a tool: expected another name, got {name!r}")
    if not tip or robot.model.existFrame(tip):
        raise RobotError(f"tip of {name}: expected a name that no frame of the arm has, got {tip!r}")
    model = robot.model.copy()
    index = model.getFrameId(robot.tip, pin.FrameType.BODY)
    flange = model.frames[index]
    model.addFrame(pin.Frame(tip, flange.parentJoint, index, flange.placement * placement, pin.FrameType.BODY))
    model.name = name
    return replace(robot, name=name, tip=tip, model=model)


def _placement(pose: ArrayLike) -> pin.SE3:
    expected = "pose of a tool: expected shape (3,) or a homogeneous (4, 4), finite"
    values = real_array("pose of a tool", pose, RobotError)
    if values.shape not in ((3,), (4, 4)) or not np.isfinite(values).all():
        raise RobotError(f"{expected}, got {values}")
    if values.shape == (3,):
        return pin.SE3(np.eye(3), values)
    rotation, bottom = values[:3, :3], values[3]
    off = np.abs(rotation.T @ rotation - np.eye(3)).max()
    if off > _ORTHONORMAL or np.linalg.det(rotation) < 0.0 or not np.array_equal(bottom, [0.0, 0.0, 0.0, 1.0]):
        raise RobotError(f"{expected} with a rotation, got {values}")
    return pin.SE3(rotation, values[:3, 3])
