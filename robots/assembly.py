"""From a pinocchio model of one chain to a robot; every source of robots ends here."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from .chain import joint_axis
from .errors import RobotError
from .limits import acceleration_limits
from .robot import Robot

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def robot_from_model(name: str, tip: str, model: Any, qdd_max: ArrayLike | None) -> Robot:
    """
    Wrap a pinocchio model whose joints are one serial chain and whose limits are set.

    Parameters
    ----------
    name
        Name of the robot.
    tip
        A frame of type BODY in the model, carried by the last joint.
    model
        A `pin.Model`; every joint has one axis.
    qdd_max
        Acceleration limits, see `load_robot`.

    Returns
    -------
    The robot.

    Raises
    ------
    RobotError
        If a number of the model is not finite.
    ValueError
        If `qdd_max` does not fit.
    """
    _require_finite(model, tip)
    joints = list(model.joints)[1:]
    continuous = np.array([joint.nq == 2 for joint in joints])
    first = [joint.idx_q for joint in joints]
    return Robot(
        name=name,
        tip=tip,
        joint_names=tuple(str(joint_name) for joint_name in list(model.names)[1:]),
        q_min=np.where(continuous, -np.inf, model.lowerPositionLimit[first]),
        q_max=np.where(continuous, np.inf, model.upperPositionLimit[first]),
        qd_max=model.velocityLimit,
        qdd_max=acceleration_limits(qdd_max, [joint_axis(joint)[0] for joint in joints]),
        tau_max=model.effortLimit,
        has_inertia=_has_inertia(model),
        model=model,
    )


def _require_finite(model: Any, tip: str) -> None:
    """Refuse a model of which any answer would be no number; files may say NaN or 1e999 anywhere."""
    for index in range(1, model.njoints):
        for what, numbers in (
            ("position", model.jointPlacements[index].homogeneous),
            ("mass and inertia of what it moves", model.inertias[index].toDynamicParameters()),
        ):
            if not np.isfinite(numbers).all():
                raise RobotError(f"joint {model.names[index]!r}: expected finite numbers for {what}, got {numbers}")
    tool = model.frames[model.getFrameId(tip, pin.FrameType.BODY)].placement.homogeneous
    if not np.isfinite(tool).all():
        raise RobotError(f"tip {tip!r}: expected finite numbers for its place, got {tool}")


def _has_inertia(model: Any) -> bool:
    """Return whether the inertia matrix is safely positive definite at pinocchio's neutral configuration."""
    matrix = np.triu(pin.crba(model, model.createData(), pin.neutral(model)))
    if not np.isfinite(matrix).all():
        return False  # masses and lengths whose products leave the range of a double
    values = np.linalg.eigvalsh(matrix, UPLO="U")
    # A link without <inertial> has an eigenvalue of 0 up to rounding; real arms stay above 1e-6 of the
    # largest.
    return bool(values[0] > 1e-12 * values[-1])
