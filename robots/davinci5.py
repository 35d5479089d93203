"""
Five joints of a da Vinci instrument arm, as a DH table.

Geometry and position limits are those of a student report on the da Vinci's kinematics (N. Adaloglou,
"Project Medical Robotics", 2017/2018), whose frames are numbered from 8: a_8 = 300 mm, d_12 = 18 mm, twists
-90, 0, 90, -90, 0 degrees, which reproduce its printed A_8^12 (but for the sign of the first term of entry
(2, 2), where the printed matrix is no rotation). Its bounds are relative to the table's start values; here
they are absolute, q being the angle in the table. Masses are not given, so there is no inertia.
"""

from __future__ import annotations

from math import radians
from typing import TYPE_CHECKING, Final

from .dh import DhRow, robot_from_dh
from .errors import RobotError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .robot import Robot

# The report gives no velocities; these are this project's choice, a brisk hand motion.
_REVOLUTE_QD_MAX = 1.0  # rad/s
_PRISMATIC_QD_MAX = 0.2  # m/s: the full insertion in one second

#: The table, for who wants it in letters (`kinqp.robots.dh_symbolic`).
DAVINCI5_ROWS: Final = (
    DhRow(
        name="theta8",
        kind="revolute",
        a=0.3,
        alpha=radians(-90),
        q_min=0.0,
        q_max=radians(60),
        qd_max=_REVOLUTE_QD_MAX,
    ),
    DhRow(name="d9", kind="prismatic", q_min=0.0, q_max=0.2, qd_max=_PRISMATIC_QD_MAX),
    DhRow(
        name="theta10",
        kind="revolute",
        alpha=radians(90),
        q_min=radians(-90),
        q_max=radians(-30),
        qd_max=_REVOLUTE_QD_MAX,
    ),
    DhRow(
        name="theta11",
        kind="revolute",
        alpha=radians(-90),
        q_min=radians(90),
        q_max=radians(135),
        qd_max=_REVOLUTE_QD_MAX,
    ),
    DhRow(name="theta12", kind="revolute", d=0.018, q_min=0.0, q_max=radians(30), qd_max=_REVOLUTE_QD_MAX),
)


def davinci5(*, tip: str | None = None, qdd_max: ArrayLike | None = None) -> Robot:
    """
    Return the five-joint da Vinci arm; its one frame is `tool`, at A_8^12.

    Parameters
    ----------
    tip
        None or `"tool"`.
    qdd_max
        Acceleration limits [rad/s^2 or m/s^2]; None for this project's defaults, as none are published.

    Returns
    -------
    The robot, without inertia; `tau_max` is inf.

    Raises
    ------
    RobotError
        If `tip` is another name.
    """
    if tip not in (None, "tool"):
        raise RobotError(f"tip: expected 'tool', the only frame of davinci5, got {tip!r}")
    return robot_from_dh("davinci5", DAVINCI5_ROWS, tip="tool", qdd_max=qdd_max)
