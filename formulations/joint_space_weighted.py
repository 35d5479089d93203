"""`joint-space-weighted`: joints are the more reluctant the closer they come to a limit (weighted least norm)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca
import numpy as np

from .base import Formulation
from .joint_space import DEFAULT_JOINT_WEIGHT

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

DEFAULT_LIMIT_WEIGHT_MAX: Final = 100.0
# A limit that is absent counts as one this far away [rad or m]: a full turn.
_ABSENT: Final = 2.0 * np.pi
# Closer than this to a limit, and beyond it, the gradient is that of this distance [rad or m].
_CLOSEST: Final = 1e-6


@dataclass(frozen=True)
class JointSpaceWeighted(Formulation):
    r"""`joint-space` with weights that grow towards joint limits, for motion towards them only (thesis 3.1.4, eq. 3.6).

    .. math::
        \min_{\varepsilon,\,\dot q^+,\,\dot q^-}\ \tfrac12\,\varepsilon' W \varepsilon
        + \tfrac12\,\dot q^{+\prime} W_q W^+ \dot q^+ + \tfrac12\,\dot q^{-\prime} W_q W^- \dot q^-
        \quad\text{s.t.}\quad J_{free}\,\dot q - \varepsilon = v,\quad J_{fixed}\,\dot q = v_{fixed},\quad
        \dot q_{lo} \le \dot q \le \dot q_{hi},\quad \dot q^+ \ge 0,\quad \dot q^- \ge 0

    with command :math:`\dot q = \dot q^+ - \dot q^-`. Of :math:`W^+_i` and :math:`W^-_i` the one that leads to the
    nearer limit is :math:`\min(1 + \kappa\,|\partial H/\partial q_i|,\ w_{max})`, the other 1, with Chan and Dubey's
    (T-RA 1995)

    .. math:: H = \sum_i \frac{(q_{max,i} - q_{min,i})^2}{4\,(q_{max,i} - q_i)(q_i - q_{min,i})}

    Eq. 3.6 asks whether the joint moved towards its limit in the last tick. Here the question is put to the command
    itself, by splitting it into its two directions (at the minimum one of the two is zero): a function of the state
    alone, and continuous. Asked of the last command, the weights jump with its sign, and joints with them: the tests
    have a run in which that takes 17 times the joints' acceleration limit. w_max keeps the weights finite, since the
    task is no equality here: where self-motion runs out, the share joint_weight w_max / sigma^2 of the hand's speed is
    lost, not all of it.

    Of the active rows "joint limits[3] upper" is joint 3 at its upper bound; "upwards[3] lower" says no more than that
    it does not move up.

    Run-time parameters
    -------------------
    task_weight : shape (m_free,)
        W's diagonal, 1 unless told otherwise.
    joint_weight : shape (nv,)
        W_q's diagonal [m^2 or rad^2 per unit of joint velocity], as in `joint-space`.
    limit_gain : shape ()
        kappa [rad or m], 1 unless told otherwise; 0 gives `joint-space`.
    limit_weight_max : shape ()
        w_max, at least 1, `DEFAULT_LIMIT_WEIGHT_MAX` unless told otherwise.
    """

    name: ClassVar[str] = "joint-space-weighted"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        eps = qp.variable("eps", tick.m_free)
        up, down = qp.variable("qd_up", tick.nv), qp.variable("qd_down", tick.nv)
        task_weight = tick.parameter("task_weight", 1.0, size=tick.m_free, lowest=0.0, positive=True)
        joint_weight = tick.parameter("joint_weight", DEFAULT_JOINT_WEIGHT, size=tick.nv, lowest=0.0, positive=True)
        gain = tick.parameter("limit_gain", 1.0, lowest=0.0, unit="rad or m")
        largest = tick.parameter("limit_weight_max", DEFAULT_LIMIT_WEIGHT_MAX, lowest=1.0)
        gradient = limit_gradient(tick.q, tick.q_min, tick.q_max)
        qd = up - down
        qp.minimize(eps, weight=task_weight, name="Cartesian error")
        # 1 + max(gradient, 0) is 1 + |gradient| where moving up leads to the nearer limit, and 1 where it leads away.
        qp.minimize(up, weight=joint_weight * ca.fmin(1 + gain * ca.fmax(gradient, 0), largest), name="upwards")
        qp.minimize(down, weight=joint_weight * ca.fmin(1 + gain * ca.fmax(-gradient, 0), largest), name="downwards")
        qp.equal(tick.J_free @ qd - eps, tick.v, name="task")
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        # Bounds of up and down by themselves would do, but compiled, five times as many of the worst states (a joint on
        # its limit, 1e-9 from a singularity) then ran into the cap on iterations: ten in 10,000.
        qp.between(0, up, np.inf, name="upwards")
        qp.between(0, down, np.inf, name="downwards")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)
        qp.feasible(
            eps=tick.J_free @ tick.qd_fixed - tick.v,
            qd_up=ca.fmax(tick.qd_fixed, 0),
            qd_down=ca.fmax(-tick.qd_fixed, 0),
        )


def limit_gradient(q: ca.SX, q_min: ca.SX, q_max: ca.SX) -> ca.SX:
    r"""Gradient of Chan and Dubey's H, shape (nv, 1) [1/rad or 1/m]: positive where the upper limit is the nearer one.

    With :math:`d^-`, :math:`d^+` the distances to the two limits it is
    :math:`(d^- - d^+)\,(1/d^- + 1/d^+)^2/4`, finite at a limit and beyond.

    Parameters
    ----------
    q, q_min, q_max : ca.SX, shape (nv, 1)
        Position and its limits (infinite: none) [rad or m].
    """
    below = ca.fmin(ca.fmax(q - q_min, _CLOSEST), _ABSENT)
    above = ca.fmin(ca.fmax(q_max - q, _CLOSEST), _ABSENT)
    return (below - above) * (1 / below + 1 / above) ** 2 / 4
