"""`minimum-acceleration-norm`: the smallest joint accelerations for the task, slowed down where limits demand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from .acceleration_task import SCALED_STRETCH_PENALTY, HandAcceleration, ScaledTask, YieldingLimits, locked_motion
from .base import Formulation, SafeStop

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

# Against a task of cost 1: at 10 rad/s^2 in all of seven joints the accelerations cost 0.0035.
ACCELERATION_WEIGHT: Final = 1e-5


@dataclass(frozen=True)
class MinimumAccelerationNorm(Formulation):
    r"""MAN (thesis 3.1.5; Zhang and Ma 2007), in a form that is always feasible.

    .. math::
        \min_{\ddot q, \varepsilon, \sigma, s}\
        \tfrac12\,(\ddot q + k\,\dot q_{prev})' W_{\ddot q}\,(\ddot q + k\,\dot q_{prev})
        + \tfrac12\,\varepsilon' W \varepsilon + \tfrac12 w_\sigma (2 - \sigma)^2 + p(s)
        \quad\text{s.t.}\quad J_{free}\,\dot q = \sigma\,v_{next} + (dt/T)\,\varepsilon,\quad
        J_{fixed}\,\dot q = v_{fixed},\quad \dot q_{lo} \le \dot q \le \dot q_{hi},\quad
        \ddot q_{lo} - s\,\ddot q_{max} \le \ddot q \le \ddot q_{hi} + s\,\ddot q_{max},\quad
        0 \le \sigma \le 1,\quad s \ge 0

    with command :math:`\dot q = \dot q_{prev} + dt\,\ddot q`. How the task is scaled: `ScaledTask`. What yields to
    what, and the penalty p: `YieldingLimits`; the task gives way before acceleration limits are exceeded.

    MAN proper has k = 0. It then never takes self-motion out of the arm once it is there: O'Neil (2002) shows that
    joint velocities may grow without bound while the tool moves on calmly; here the limits end that. `joint_damping` k
    makes self-motion die away with the time constant 1/k.

    Parameters
    ----------
    torque_limits : bool
        Keep M qdd + h within +-tau_max, where known.

    Run-time parameters
    -------------------
    acceleration_weight : shape (nv,)
        Diagonal of the weight on accelerations [s^4/rad^2 or s^4/m^2].
    joint_damping
        k [1/s].
    task_weight : shape (m_free,)
        W's diagonal; large, see `ScaledTask`.
    time_constant
        See `HandAcceleration` [s].
    scale_penalty, stretch_penalty, torque_stretch_penalty
        w_sigma, and the slopes of p at zero for the two stretches.
    """

    torque_limits: bool = False

    name: ClassVar[str] = "minimum-acceleration-norm"
    safe_stop: ClassVar[SafeStop] = "braking"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        hand = HandAcceleration.of(tick)
        ahead, rest = locked_motion(qp, tick, hand)
        qdd = hand.acceleration(ahead)
        weight = tick.parameter("acceleration_weight", ACCELERATION_WEIGHT, size=tick.nv, lowest=0.0, positive=True)
        damping = tick.parameter("joint_damping", 0.0, lowest=0.0, unit="1/s")
        qp.minimize(qdd + damping * tick.qd_prev, weight=weight, name="acceleration norm")
        ScaledTask.declare(qp, tick, hand, ahead)
        limits = YieldingLimits.declare(
            qp, tick, hand, ahead, torques=self.torque_limits, penalty=SCALED_STRETCH_PENALTY
        )
        qp.command(hand.command(ahead))
        left = (hand.T / tick.dt) * (tick.J_free @ tick.qd_fixed)
        qp.feasible(motion=0, eps=left, scale=0, **limits.feasible(rest))
