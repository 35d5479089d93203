"""`joint-space-acceleration`: joint accelerations as variables, the mode as an equality on where they lead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from .acceleration_task import HandAcceleration, YieldingLimits, locked_motion
from .base import Formulation, SafeStop
from .joint_space import DEFAULT_JOINT_WEIGHT

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick


@dataclass(frozen=True)
class JointSpaceAcceleration(Formulation):
    r"""`joint-space` (thesis 4.5.4) one level up: no command is further than dt qdd_max from the last one.

    .. math::
        \min_{\varepsilon, \ddot q, s}\ \tfrac12\,\varepsilon' W \varepsilon
        + \tfrac12\,(\dot q_{prev} + T \ddot q)' W_q (\dot q_{prev} + T \ddot q) + p(s)
        \quad\text{s.t.}\quad J_{free}\,\ddot q + \dot J_{free}\,\dot q_{prev} = (v + \varepsilon - \dot x)/T,\quad
        J_{fixed}\,\dot q = v_{fixed},\quad \dot q_{lo} \le \dot q \le \dot q_{hi},\quad
        \ddot q_{lo} - s\,\ddot q_{max} \le \ddot q \le \ddot q_{hi} + s\,\ddot q_{max},\quad s \ge 0

    with command :math:`\dot q = \dot q_{prev} + dt\,\ddot q`. For the tool's last velocity and T see
    `HandAcceleration`, for s and its penalty p `YieldingLimits`. Both costs look ahead by T: at constant acceleration
    :math:`\dot q_{prev} + T\ddot q` is the joint velocity then, and eps the Cartesian error. The joint velocities
    follow those of `joint-space` with the lag T, so that self-motion dies away too; with T = dt and wide acceleration
    limits the command is that of `joint-space`.

    Parameters
    ----------
    torque_limits : bool
        Keep M qdd + h within +-tau_max, where known.

    Run-time parameters
    -------------------
    task_weight, joint_weight
        As in `joint-space`.
    time_constant
        T [s]; at least one period.
    stretch_penalty, torque_stretch_penalty
        Slopes of p at zero for the two stretches.
    """

    torque_limits: bool = False

    name: ClassVar[str] = "joint-space-acceleration"
    safe_stop: ClassVar[SafeStop] = "braking"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        eps = qp.variable("eps", tick.m_free)
        hand = HandAcceleration.of(tick)
        ahead, rest = locked_motion(qp, tick, hand)
        task_weight = tick.parameter("task_weight", 1.0, size=tick.m_free, lowest=0.0, positive=True)
        joint_weight = tick.parameter("joint_weight", DEFAULT_JOINT_WEIGHT, size=tick.nv, lowest=0.0, positive=True)
        qp.minimize(eps, weight=task_weight, name="Cartesian error")
        qp.minimize(ahead, weight=joint_weight, name="joint speed")
        qp.equal(tick.J_free @ ahead - eps, tick.v - hand.curvature, name="task")
        limits = YieldingLimits.declare(qp, tick, hand, ahead, torques=self.torque_limits)
        qp.command(hand.command(ahead))
        qp.feasible(eps=tick.J_free @ rest - (tick.v - hand.curvature), motion=0, **limits.feasible(rest))
