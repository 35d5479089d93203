"""Admittance, symbolically: the hand's force becomes a velocity of the tool, as if the tool were a mass in oil."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

if TYPE_CHECKING:
    from ..formulations import Mode

# Lengths below this have no direction [N, N m, m/s, rad/s].
_SHORTEST = 1e-12


def wrench_along(mode: Mode, pose: ca.SX, wrench: ca.SX) -> ca.SX:
    """Write a wrench at the tool centre point as the one that does the same work in the mode's rows.

    Where T takes the tool's twist to the mode's, it is T^-T F: turned into the mode's axes, and its torque taken about
    the pivot, where the mode has one.

    Parameters
    ----------
    mode : Mode
        Motion mode.
    pose : ca.SX, shape (4, 4)
        Pose of the tool centre point in the world.
    wrench : ca.SX, shape (6, 1)
        Force and torque on the tool at the tool centre point, world axes [N, N m].

    Returns
    -------
    ca.SX, shape (6, 1)
        Along the mode's axes [N, N m].
    """
    twist_map = mode.twist_map(pose)
    rotation = twist_map[:3, :3]
    torque = wrench[3:]
    if mode.depth:
        torque = torque - mode.depth * ca.cross(pose[:3, 2], wrench[:3])
    return ca.vertcat(rotation @ wrench[:3], rotation @ torque)


def outside_dead_zone(vector: ca.SX, radius: ca.SX) -> ca.SX:
    """Take a ball out of the middle: zero inside, shortened by `radius` outside, so that there is no step at its edge.

    The same in all directions (thesis 2.3.1: "a symmetric dead zone around the zero point").
    """
    return vector * ca.fmax(0, 1 - radius / ca.fmax(ca.norm_2(vector), _SHORTEST))


def admit(v: ca.SX, force: ca.SX, mass: ca.SX, damping: ca.SX, dt: ca.SX) -> ca.SX:
    r"""Advance M dv/dt + B v = F by one period in which the force is constant, exactly.

    .. math:: v' = e^{-x} v + \frac{1 - e^{-x}}{B} F,\quad x = B\,dt / M

    With t = tanh(x/2) the first factor is (1 - t)/(1 + t) and the numerator of the second 2t/(1 + t), which lose no
    digits where x is small: however small the damping, a mass is accelerated by F dt / M.

    Parameters
    ----------
    v : ca.SX, shape (m, 1)
        Velocity before [m/s, rad/s].
    force : ca.SX, shape (m, 1)
        [N, N m].
    mass, damping : ca.SX, shape (m, 1)
        Positive [kg, kg m^2; N s/m, N m s/rad].
    dt : ca.SX, scalar
        [s].

    Notes
    -----
    Source: thesis 2.3.1 and figure 2.4; shared-control drilling robot, "Admittance".
    """
    t = ca.tanh(0.5 * damping * dt / mass)
    return (1 - t) / (1 + t) * v + 2 * t / (1 + t) / damping * force


def slowed(v: ca.SX, loss: ca.SX) -> ca.SX:
    """Shorten a velocity by `loss`, at most to zero, keeping its direction [m/s, or rad/s]."""
    return outside_dead_zone(v, loss)
