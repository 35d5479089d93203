"""`task-scaling`: as much of the hand's speed as the limits allow, in its direction; then the least joint motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from .base import Formulation
from .task_scale import follow_scaled, scale_threshold

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

# With 0.003 the scale is the largest possible somewhat closer to singularities (over the LBR's workspace 0.02 % more
# speed), but pulled outwards at the stretched arm it chatters at 2,500 sign changes of acceleration a second, and with
# 0.01 not at all.
DEFAULT_SCALE_THRESHOLD: Final = 0.01


@dataclass(frozen=True)
class TaskScaling(Formulation):
    r"""The largest task scale first, the least joint motion second (thesis 3.1.7).

    .. math::
        \max_{\dot q,\,s}\ s,\ \text{then}\ \min_{\dot q}\ \tfrac12\,\dot q' W_q\,\dot q
        \quad\text{s.t.}\quad J_{free}\,\dot q = s\,v,\quad J_{fixed}\,\dot q = v_{fixed},\quad
        \dot q_{lo} \le \dot q \le \dot q_{hi},\quad 0 \le s \le 1

    The QP counterpart of saturation in the null space (Flacco, De Luca, Khatib, ICRA 2012 and T-RO 2015): joints at
    their bounds are left there, the others make up for them by self-motion, and only when these run out is the task
    slowed down, its direction kept. As one QP: the scale's exact penalty of
    `kinqp.formulations.task_scale.follow_scaled` with a small sigma_0, below which alone the two aims are traded.

    At a singularity joint speeds rise to their bounds, without regard to accelerations: `minimum-velocity-norm` is the
    same problem with a sigma_0 that slows down before.

    Run-time parameters
    -------------------
    joint_weight : shape (nv,)
        W_q's diagonal, 1 unless told otherwise.
    scale_threshold : shape ()
        sigma_0 [m or rad], 0.01 unless told otherwise.
    """

    name: ClassVar[str] = "task-scaling"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        qd = qp.variable("qd", tick.nv)
        weight = tick.parameter("joint_weight", 1.0, size=tick.nv, lowest=0.0, positive=True)
        qp.minimize(qd, weight=weight, name="joint speed")
        follow_scaled(qp, tick, qd, scale_threshold(tick, DEFAULT_SCALE_THRESHOLD))
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)
        qp.feasible(qd=tick.qd_fixed)
