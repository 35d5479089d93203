"""Acceleration limits, which neither URDF files nor most data sheets give."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .checks import FloatArray, finite_vector
from .errors import RobotError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

#: This project's default where no acceleration limit is known [rad/s^2]. KUKA publishes none for the LBR.
DEFAULT_REVOLUTE_QDD_MAX = 10.0

#: The same for a prismatic joint [m/s^2]: a tenth of gravity, gentle for an instrument's insertion axis.
DEFAULT_PRISMATIC_QDD_MAX = 1.0


def acceleration_limits(qdd_max: ArrayLike | None, prismatic: Sequence[bool]) -> FloatArray:
    """
    Return the acceleration limit of every joint.

    Parameters
    ----------
    qdd_max
        One positive number for all joints or one for each [rad/s^2 or m/s^2]; None for the project's
        defaults.
    prismatic
        For each joint, whether it is prismatic.

    Returns
    -------
    Shape (nv,), rad/s^2 or m/s^2.

    Raises
    ------
    ValueError
        If `qdd_max` has the wrong shape or is not finite.
    RobotError
        If an entry is not positive.
    """
    nv = len(prismatic)
    if qdd_max is None:
        return np.where(prismatic, DEFAULT_PRISMATIC_QDD_MAX, DEFAULT_REVOLUTE_QDD_MAX)
    value = np.full(nv, qdd_max) if np.isscalar(qdd_max) else qdd_max
    limits = finite_vector("qdd_max", value, nv)
    if not (limits > 0.0).all():
        index = int(np.argmin(limits > 0.0))
        raise RobotError(
            f"qdd_max: expected positive accelerations, got {limits[index]} at index {index}; "
            "leave qdd_max out for the default"
        )
    return limits
