"""`semicircle`: the thesis's experiment."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...control import PathFollower, SemicirclePath
from ...formulations import DEFAULT_DT, Mode
from ...robots import load_robot
from .base import Phase, Scenario

# Tool pointing down, 6 cm above the table, elbow at -90 deg; chosen among round numbers such that the semicircle runs
# 3 cm deep into the elbow limit and all else (other limits, singularities) stays out of play.
START_DEG: Final = (-55.0, 65.0, 10.0, -90.0, -5.0, 30.0, 0.0)
RADIUS: Final = 0.30
SPEED: Final = 0.20
RAMP: Final = 0.40
GAIN: Final = 5.0


def semicircle() -> Scenario:
    """Guide the LBR Med 14 along the thesis's semicircle into its elbow limit (thesis 5.2).

    The thesis describes a semicircle at the foot of the robot, in a plane perpendicular to the ground, that leads the
    elbow into its limit; it gives no measures. These are ours: `RADIUS` [m], `SPEED` [m/s], `RAMP` [s] and `GAIN`
    [1/s] of the `PathFollower`. The mode is fix orientation, for which the thesis develops its method (4.4.1).

    The elbow's angle depends on the distance from shoulder to wrist alone. With the orientation fixed, the tool
    therefore can't enter a sphere around the shoulder (shifted by the hand); the semicircle cuts through that sphere,
    and the tool has to slide along its surface.
    """
    robot = load_robot("lbr_med14")
    q0 = np.deg2rad(START_DEG)
    path = SemicirclePath(
        start=robot.pose(q0)[:3, 3],
        across=np.array([0.0, 1.0, 0.0]),
        over=np.array([0.0, 0.0, 1.0]),
        radius=RADIUS,
    )
    guide = PathFollower(path, speed=SPEED, ramp=RAMP, gain=GAIN)
    return Scenario(
        name="semicircle",
        description="the thesis's experiment: a vertical semicircle into the elbow limit, orientation fixed",
        robot=robot,
        q0=q0,
        dt=DEFAULT_DT,
        phases=(Phase(Mode.fix_orientation(), guide, guide.duration),),
        watched_joints=(3,),
    )
