"""Drift compensation, symbolically: how far the tool has left the pose that a mode was engaged at, and the way back.

Velocities that keep the locked rows exactly still let the pose drift: a command is kept for a whole period, over which
the Jacobian changes, and what that leaves adds up. (Thesis 2.3, "Drift compensation with dead zone (fine positioning)";
shared-control drilling robot, "e an adjustable error term for drift compensation".)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ..formulations.constraints.base import limited
from .admittance import outside_dead_zone

if TYPE_CHECKING:
    from ..formulations import Mode

# Sines below this are a rotation's angle.
_SMALL = 1e-9


def rotation_vector(rotation: ca.SX) -> ca.SX:
    """Axis times angle of a rotation matrix, shape (3, 1) [rad]; at half a turn, where the axis is open, zero."""
    sine_axis = 0.5 * ca.vertcat(
        rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    )
    sine = ca.norm_2(sine_axis)
    angle = ca.atan2(sine, 0.5 * (ca.trace(rotation) - 1))
    turns = sine > _SMALL
    return sine_axis * ca.if_else(turns, angle / ca.if_else(turns, sine, 1), 1)


def pose_error(mode: Mode, pose: ca.SX, anchor: ca.SX) -> ca.SX:
    """Way from a pose to the anchor, along the mode's axes, shape (6, 1) [m, rad].

    Parameters
    ----------
    mode : Mode
        Motion mode; with a pivot, the translations are the way from the shaft to the anchored pivot.
    pose, anchor : ca.SX, shape (4, 4) and (3, 4)
        Where the tool centre point is, and where it was when the mode was engaged; world.
    """
    axes = ca.SX(np.array(mode.axes))
    if mode.frame == "tool":
        axes = axes @ pose[:3, :3].T
    there = anchor[:, 3] + mode.depth * anchor[:, 2]
    here = pose[:3, 3] + mode.depth * pose[:3, 2]
    return ca.vertcat(axes @ (there - here), axes @ rotation_vector(anchor[:, :3] @ pose[:3, :3].T))


def correction(error: ca.SX, dead_zone: ca.SX, gain: ca.SX, speed: ca.SX, dt: ca.SX) -> ca.SX:
    """Velocity that takes an error back, shape of `error` [m/s, or rad/s].

    Nothing within the dead zone; beyond it `gain` times what is beyond, at most `speed`, and never more than what
    there is to go in one period.
    """
    return limited(ca.fmin(gain, 1 / dt) * outside_dead_zone(error, dead_zone), speed)
