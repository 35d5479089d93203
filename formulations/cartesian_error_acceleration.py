"""`cartesian-error-acceleration`: the error of the guided rows as variable, accelerations within bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca

from .acceleration_task import HandAcceleration, YieldingLimits
from .algebra import dot, matmul
from .base import Formulation, SafeStop
from .inverse import rounding_of_inverse

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

# Of braking self-motion: above what the task may gain, below that of the acceleration limits.
BRAKE_PENALTY: Final = 1.0

# Joint speed below which nothing moves [rad/s or m/s]; dropped at once that is an acceleration of 1e-5.
SLOWEST: Final = 1e-8


@dataclass(frozen=True)
class CartesianErrorAcceleration(Formulation):
    r"""`cartesian-error` (thesis 4.5.2) one level up: no command is further than dt qdd_max from the last one.

    With N_c the projector onto the null space of the locked rows and q_f = J_fixed^+ v_fixed the command is

    .. math::
        \dot q = \dot q_f + (1 - \beta)(1 - dt/T)\,N_c\,\dot q_{prev} + (dt/T)\,J^\#(w + \varepsilon)

    in which w is such that, undamped, eps = 0 and beta = 0 give
    :math:`J_{free}\,\ddot q + \dot J_{free}\,\dot q_{prev} = (v - \dot x)/T` (see `HandAcceleration`): the part of the
    joint velocity that leaves the locked rows alone follows J# v with a lag of first order, T. Solved is

    .. math::
        \min_{\varepsilon, \beta, s}\ \tfrac12\,\varepsilon' W \varepsilon
        + \tfrac12 w_\beta (1 + \beta)^2 + p(s)
        \quad\text{s.t.}\quad \dot q_{lo} \le \dot q \le \dot q_{hi},\quad
        \ddot q_{lo} - s\,\ddot q_{max} \le (\dot q - \dot q_{prev})/dt \le \ddot q_{hi} + s\,\ddot q_{max},\quad
        s \ge 0,\quad 0 \le \beta \le 1

    Self-motion is out of the task's reach, as in `cartesian-error`: what there is of it in the last command dies away
    with T, or, where limits leave no time for that, as fast as `beta` must brake. eps = -w with beta = 1 is zero
    motion, and feasible while `v_fixed` is zero. What yields to what, and the penalty p: `YieldingLimits`; braking
    self-motion comes before exceeding acceleration limits. With T = dt and wide acceleration limits the command is that
    of `cartesian-error`.

    Parameters
    ----------
    torque_limits : bool
        Keep M qdd + h within +-tau_max, where known.

    Run-time parameters
    -------------------
    task_weight, damping_threshold, damping_max
        As in `cartesian-error`.
    time_constant
        T [s]; at least one period.
    brake_penalty, stretch_penalty, torque_stretch_penalty
        w_beta, and the slopes of p at zero for the two stretches.
    """

    torque_limits: bool = False

    name: ClassVar[str] = "cartesian-error-acceleration"
    safe_stop: ClassVar[SafeStop] = "braking"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        eps = qp.variable("eps", tick.m_free)
        brake = qp.variable("brake", 1)
        hand = HandAcceleration.of(tick)
        weight = tick.parameter("task_weight", 1.0, size=tick.m_free, lowest=0.0, positive=True)
        brake_weight = tick.parameter("brake_penalty", BRAKE_PENALTY, lowest=0.0, positive=True)
        qp.minimize(eps, weight=weight, name="Cartesian error")
        qp.minimize(1 + brake, weight=brake_weight, name="brake")
        qp.between(0, brake, 1, name="brake")
        within = tick.qd_prev_free
        # What is left of none is rounding; `brake` with nothing but that in its column makes rows almost dependent.
        within = ca.if_else(dot(within, within) > SLOWEST**2, within, 0)
        across = tick.qd_prev - within
        ratio = hand.T / tick.dt
        # Where the part that moves the locked rows is going.
        towards = across + ratio * (tick.qd_fixed - across)
        w = tick.v - hand.curvature - matmul(tick.J_free, towards)
        ahead = towards + matmul(tick.inverse, w) - ((ratio - 1) * within) * brake + tick.inverse @ eps
        known = rounding_of_inverse(ca.vertcat(w, ratio * within))
        limits = YieldingLimits.declare(qp, tick, hand, ahead, torques=self.torque_limits, known=known)
        qp.command(hand.command(ahead))
        qp.feasible(eps=-w, brake=1, **limits.feasible(hand.ahead(tick.qd_fixed)))
