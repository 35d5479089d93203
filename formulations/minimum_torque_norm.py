"""`minimum-torque-norm`: the smallest joint torques for the task, slowed down where limits demand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from .acceleration_task import (
    SCALED_STRETCH_PENALTY,
    HandAcceleration,
    ScaledTask,
    YieldingLimits,
    locked_motion,
    torque,
)
from .base import Formulation, SafeStop

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

# Against a task of cost 1: 1e-5 of the square of a torque, so that 300 Nm cost as much as the task.
TORQUE_WEIGHT: Final = 1e-5
# A wrist joint of 1e-3 kg m^2 costs 1e-11 by torques alone, too flat for most solvers; this counts less than torques do
# from an inertia of 0.3 kg m^2 on. With a tenth of it Clarabel gave up on one tick of the semicircle.
REGULARISATION: Final = 1e-6


@dataclass(frozen=True)
class MinimumTorqueNorm(Formulation):
    r"""MTN (thesis 3.1.5; Hollerbach and Suh 1987), in a form that is always feasible.

    .. math::
        \min\ \tfrac12\,\tau' W_\tau \tau
        + \tfrac12\,(\ddot q + k\,\dot q_{prev})' W_{\ddot q}\,(\ddot q + k\,\dot q_{prev}) + \ldots,
        \qquad \tau = M \ddot q + h

    with all else as in `minimum-acceleration-norm`. Torques are those of the present position and the last velocity,
    gravity included.

    Torques are smallest for the moment only: self-motion is thrown about to lighten the load, and braking it later
    costs more than was saved. Hollerbach and Suh found whipping motions and joint velocities without bound; here the
    limits end that, with joints at their velocity limits. `joint_damping` k, with a larger `acceleration_weight`, calms
    it.

    Parameters
    ----------
    torque_limits : bool
        Keep tau within +-tau_max, where known.

    Run-time parameters
    -------------------
    torque_weight : shape (nv,)
        W_tau's diagonal [1/(Nm)^2 or 1/N^2].
    acceleration_weight : shape (nv,)
        Diagonal of the small weight that keeps the problem strictly convex [s^4/rad^2 or s^4/m^2].
    task_weight, joint_damping, time_constant, scale_penalty, stretch_penalty, torque_stretch_penalty
        As in `minimum-acceleration-norm`.

    Raises
    ------
    RobotError
        When lowered for an arm without link inertias.
    """

    torque_limits: bool = False

    name: ClassVar[str] = "minimum-torque-norm"
    safe_stop: ClassVar[SafeStop] = "braking"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        hand = HandAcceleration.of(tick)
        ahead, rest = locked_motion(qp, tick, hand)
        qdd = hand.acceleration(ahead)
        torque_weight = tick.parameter("torque_weight", TORQUE_WEIGHT, size=tick.nv, lowest=0.0, positive=True)
        weight = tick.parameter("acceleration_weight", REGULARISATION, size=tick.nv, lowest=0.0, positive=True)
        damping = tick.parameter("joint_damping", 0.0, lowest=0.0, unit="1/s")
        qp.minimize(torque(tick, qdd), weight=torque_weight, name="torque norm")
        qp.minimize(qdd + damping * tick.qd_prev, weight=weight, name="acceleration norm")
        ScaledTask.declare(qp, tick, hand, ahead)
        limits = YieldingLimits.declare(
            qp, tick, hand, ahead, torques=self.torque_limits, penalty=SCALED_STRETCH_PENALTY
        )
        qp.command(hand.command(ahead))
        left = (hand.T / tick.dt) * (tick.J_free @ tick.qd_fixed)
        qp.feasible(motion=0, eps=left, scale=0, **limits.feasible(rest))
