"""`minimum-velocity-norm`: of all motions that follow the hand, the one with the least joint speed (MVN)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from .base import Formulation
from .task_scale import Task, check_task, follow_exactly, follow_scaled, scale_threshold

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

DEFAULT_SCALE_THRESHOLD: Final = 0.08


@dataclass(frozen=True)
class MinimumVelocityNorm(Formulation):
    r"""Least joint speed with the task as an equality, scaled down where it can't be met (thesis 3.1.5, MVN).

    .. math::
        \min_{\dot q,\,s}\ \tfrac12\,\dot q' W_q\,\dot q + \tfrac12\,(2 - s)^2\,|v|^2/\sigma_0^2
        \quad\text{s.t.}\quad J_{free}\,\dot q = s\,v,\quad J_{fixed}\,\dot q = v_{fixed},\quad
        \dot q_{lo} \le \dot q \le \dot q_{hi},\quad 0 \le s \le 1

    The hand's direction is never bent, only its speed reduced, at limits and where |J# v| would exceed |v|/sigma_0;
    elsewhere s is exactly 1 and the command the pseudo-inverse's. Zero motion is feasible, s = 0. The thesis's own
    form, ``task="hard"``, has s = 1 and is infeasible where a limit or a singularity is in the way: a safe stop.
    `kinqp.formulations.task_scale.follow_scaled` has the details, drift correction among them.

    Parameters
    ----------
    task : {"scaled", "hard"}
        See above.

    Run-time parameters
    -------------------
    joint_weight : shape (nv,)
        W_q's diagonal, 1 unless told otherwise.
    scale_threshold : shape ()
        sigma_0 [m or rad], unless told otherwise 0.08, as for the damped inverse: the smallest singular value without
        loss of speed.
    """

    task: Task = "scaled"

    name: ClassVar[str] = "minimum-velocity-norm"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_task(self.task)

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        qd = qp.variable("qd", tick.nv)
        weight = tick.parameter("joint_weight", 1.0, size=tick.nv, lowest=0.0, positive=True)
        qp.minimize(qd, weight=weight, name="joint speed")
        if self.task == "hard":
            follow_exactly(qp, tick, qd)
        else:
            follow_scaled(qp, tick, qd, scale_threshold(tick, DEFAULT_SCALE_THRESHOLD))
            qp.feasible(qd=tick.qd_fixed)
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)
