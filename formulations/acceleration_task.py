"""What the acceleration-level formulations share: the hand's velocity as an acceleration, and limits that can yield.

Accelerations are stated by where they lead: `ahead` is qd_prev + T qdd, the joint velocity after the time constant T at
constant acceleration. In these units (T is 10 ms) the numbers of the QP are of order one. With qdd itself as variable
the Hessian is T^2 = 1e-4 times smaller beside the same penalties, and interior-point solvers lose up to four digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca

from .algebra import matmul

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

# 10 ms, a bandwidth of 16 Hz: above what a hand does, and white noise on the hand's velocity is amplified into joint
# accelerations ten times less than by the shortest one possible, a period of 1 ms.
DEFAULT_TIME_CONSTANT: Final = 0.01
# Weight of exceeding acceleration limits, where the task costs 1/2 |eps|^2, some 0.5 for a fast hand; a hundred times
# that where the task has `DIRECTION_WEIGHT`. Torque limits have a tenth of it. Evidence: docs/acceleration-level.md.
STRETCH_PENALTY: Final = 100.0
SCALED_STRETCH_PENALTY: Final = 1e4
# Stretch at which the slope of its penalty has doubled: beyond any that a calm arm needs. With a curvature as large as
# the slope, states that need a large stretch would have gradients next to which the joint weights drown.
STRETCH_SCALE: Final = 30.0
# Of leaving the hand's direction, in the formulations that keep to it: 1 cm/s costs a twentieth of standing still.
DIRECTION_WEIGHT: Final = 1e3


@dataclass(frozen=True)
class HandAcceleration:
    r"""The hand's velocity as a request for acceleration.

    The tool follows the hand with a lag of first order, T, from the tool's velocity in the tick before,
    :math:`\dot x = J_{free}\,\dot q_{prev} - dt\,\dot J_{free}\,\dot q_{prev}` (the Jacobian being that of the present
    position):

    .. math:: J_{free}\,\ddot q + \dot J_{free}\,\dot q_{prev} = (v + \varepsilon - \dot x)/T

    Sampled, the curvature cancels: without error the tool moves at :math:`\dot x + (dt/T)(v - \dot x)` next, and no
    error stays. T = dt asks for v within one period, as the velocity level does.

    Attributes
    ----------
    T : ca.SX, scalar
        Time constant, at least one period [s].
    dt : ca.SX, scalar
        Control period [s].
    qd_prev : ca.SX, shape (nv, 1)
        Last command [rad/s or m/s].
    Jdot_qd : ca.SX, shape (m_free, 1)
        Acceleration of the guided rows at constant joint velocity [m/s^2, rad/s^2].
    """

    T: ca.SX
    dt: ca.SX
    qd_prev: ca.SX
    Jdot_qd: ca.SX

    @classmethod
    def of(cls, tick: Tick) -> HandAcceleration:
        """Make it from a tick; adds the run-time parameter `time_constant`."""
        T = ca.fmax(tick.parameter("time_constant", DEFAULT_TIME_CONSTANT, lowest=0.0, unit="s"), tick.dt)
        return cls(T, tick.dt, tick.qd_prev, tick.Jdot_qd[list(tick.mode.free_rows)])

    @property
    def curvature(self) -> ca.SX:
        """What J_free `ahead` falls short of the tool's velocity T ahead, shape (m_free, 1) [m/s, rad/s]."""
        return (self.T - self.dt) * self.Jdot_qd

    def ahead(self, qd: ca.SX) -> ca.SX:
        """Velocity T ahead at the acceleration that leads to `qd` in one period, shape (nv, 1) [rad/s or m/s]."""
        return self.qd_prev + (self.T / self.dt) * (qd - self.qd_prev)

    def command(self, ahead: ca.SX) -> ca.SX:
        """Inverse of `ahead`: the velocity one period ahead, shape (nv, 1) [rad/s or m/s]."""
        return self.qd_prev + (self.dt / self.T) * (ahead - self.qd_prev)

    def acceleration(self, ahead: ca.SX) -> ca.SX:
        """Joint acceleration that leads there, shape (nv, 1) [rad/s^2 or m/s^2]."""
        return (ahead - self.qd_prev) / self.T


@dataclass(frozen=True)
class YieldingLimits:
    """Limits on the acceleration of a formulation, and what gives way where they leave nothing.

    In this order: the locked rows hold exactly; position and velocity limits ("joint limits") hold; acceleration limits
    stretch by one common factor 1 + `stretch` only if nothing else is possible; torque limits, if asked for, by one
    common factor 1 + `torque_stretch`; then comes the task. (An arm whose motors can't hold it is not let fall faster
    than its acceleration limits.) Both stretches carry the cost 1/2 w (1 + s)^2 with s >= 0. Its slope at zero, w,
    makes it an exact penalty: unlike with 1/2 w s^2 the answer has s = 0 wherever that is possible, as long as what
    comes after it gains less than w from a unit of s.

    Attributes
    ----------
    tick : Tick
    hand : HandAcceleration
    torques : bool
        Whether torques are limited.
    """

    tick: Tick
    hand: HandAcceleration
    torques: bool

    @classmethod
    def declare(
        cls,
        qp: QuadraticProgram,
        tick: Tick,
        hand: HandAcceleration,
        ahead: ca.SX,
        *,
        torques: bool,
        penalty: float = STRETCH_PENALTY,
        known: ca.SX | float = 0.0,
    ) -> YieldingLimits:
        """Add limits on `ahead`, affine in the variables, (nv, 1), and parameters of what exceeding them costs.

        `known`: how well `ahead` is known, scalar [rad/s or m/s]; the joint limits are widened by it.
        """
        stretch = qp.variable("stretch", 1)
        weight = tick.parameter("stretch_penalty", penalty, lowest=0.0, positive=True)
        qp.minimize(1 + stretch / STRETCH_SCALE, weight=STRETCH_SCALE * weight, name="acceleration limits")
        qp.between(0, stretch, ca.inf, name="stretch of acceleration limits")
        qp.between(hand.ahead(tick.qd_lo) - known, ahead, hand.ahead(tick.qd_hi) + known, name="joint limits")
        more = (hand.T * tick.qdd_usable) * stretch
        qp.between(tick.qd_prev + hand.T * tick.qdd_lo, ahead + more, ca.inf, name="lower acceleration limits")
        qp.between(-ca.inf, ahead - more, tick.qd_prev + hand.T * tick.qdd_hi, name="upper acceleration limits")
        if torques:
            stretch = qp.variable("torque_stretch", 1)
            weight = tick.parameter("torque_stretch_penalty", 0.1 * penalty, lowest=0.0, positive=True)
            qp.minimize(1 + stretch / STRETCH_SCALE, weight=STRETCH_SCALE * weight, name="torque limits")
            qp.between(0, stretch, ca.inf, name="stretch of torque limits")
            tau = torque(tick, hand.acceleration(ahead))
            # An unknown limit has nothing to stretch; infinity as a coefficient would make the row NaN.
            more = ca.if_else(tick.tau_max < ca.inf, tick.tau_max, 0) * stretch
            qp.between(-tick.tau_max, tau + more, ca.inf, name="lower torque limits")
            qp.between(-ca.inf, tau - more, tick.tau_max, name="upper torque limits")
        return cls(tick, hand, torques)

    def feasible(self, ahead: ca.SX) -> dict[str, ca.SX]:
        """Give the stretches that a certain `ahead`, shape (nv, 1), needs, by the names of their variables."""
        tick, qdd = self.tick, self.hand.acceleration(ahead)
        excess = ca.vertcat(qdd - tick.qdd_hi, tick.qdd_lo - qdd) / ca.vertcat(tick.qdd_usable, tick.qdd_usable)
        values = {"stretch": ca.fmax(ca.mmax(excess), 0)}
        if self.torques:
            values["torque_stretch"] = ca.fmax(ca.mmax(ca.fabs(torque(tick, qdd)) / tick.tau_max) - 1, 0)
        return values


@dataclass(frozen=True)
class ScaledTask:
    r"""The task in the hand's direction, slowed down where limits demand.

    :math:`J_{free}\,\dot q = \sigma\,v_{next} + (dt/T)\,\varepsilon` with
    :math:`v_{next} = \dot x + (dt/T)(v - \dot x)`, the velocity that `HandAcceleration` gives the tool next. sigma = 1
    is that request, :math:`J_{free}\,\ddot q + \dot J_{free}\,\dot q_{prev} = (v - \dot x)/T`; sigma < 1 shortens the
    tool's next velocity and not its change: with the change scaled, the tool could not be stopped at a limit. sigma = 0
    is standing still, which all rows admit while `v_fixed` is zero.

    The cost of slowing down, 1/2 w (2 - sigma)^2, is an exact penalty like those of the stretches: sigma = 1 wherever
    that is possible at a cost of less than w. eps, with a large weight, makes the equality a task and not a
    constraint: the direction is left by what the acceleration limits take (a tool that grazes a limit at speed can't be
    stopped in its direction in time), and where the arm is singular.

    What the scale can't do is slide along a limit: the arm stops there until the hand pulls another way.
    """

    @staticmethod
    def declare(qp: QuadraticProgram, tick: Tick, hand: HandAcceleration, ahead: ca.SX) -> None:
        """Add scale and error, the rows of the task for `ahead`, (nv, 1), and the parameters of their costs."""
        eps = qp.variable("eps", tick.m_free)
        weight = tick.parameter("task_weight", DIRECTION_WEIGHT, size=tick.m_free, lowest=0.0, positive=True)
        qp.minimize(eps, weight=weight, name="task direction")
        scale = qp.variable("scale", 1)
        weight = tick.parameter("scale_penalty", 1.0, lowest=0.0, positive=True)
        qp.minimize(2 - scale, weight=weight, name="task scale")
        qp.between(0, scale, 1, name="task scale")
        moving = matmul(tick.J_free, tick.qd_prev)
        x = moving - tick.dt * hand.Jdot_qd
        ratio = hand.T / tick.dt
        v_next = x + (tick.v - x) / ratio
        qp.equal(tick.J_free @ ahead - (ratio * v_next) * scale - eps, (1 - ratio) * moving, name="task")


def locked_motion(qp: QuadraticProgram, tick: Tick, hand: HandAcceleration) -> tuple[ca.SX, ca.SX]:
    """Add the variable of the joint-space formulations, T/dt (qd - qd_fixed), and the rows of the mode for it.

    J_fixed qd = v_fixed for the velocity that is sent is then J_fixed `motion` = 0, which has a solution whatever the
    rank of J_fixed. Stated as J qdd + Jdot qd = 0 the rows would hold to first order in dt only, and drift.

    Returns
    -------
    ahead, rest : ca.SX, shape (nv, 1)
        Joint velocity T ahead: as an expression in the variable, and of the smallest admissible motion [rad/s or m/s].
    """
    motion = qp.variable("motion", tick.nv)
    qp.equal(tick.J_fixed @ motion, 0, name="mode")
    rest = hand.ahead(tick.qd_fixed)
    return rest + motion, rest


def torque(tick: Tick, qdd: ca.SX) -> ca.SX:
    """Joint torques M qdd + h at the present position and the last velocity, shape (nv, 1) [Nm or N]."""
    return tick.M @ qdd + tick.h
