"""`minimum-kinetic-energy`: of all motions that follow the hand, the one with the least kinetic energy (MKE)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca

from .algebra import factor_of_positive, matmul
from .base import Formulation
from .task_scale import Task, check_task, follow_exactly, follow_scaled, scale_threshold

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

# In the norm of the inertia light wrists hardly count; with this, as much speed is lost over the LBR's workspace as
# `minimum-velocity-norm` loses with its 0.08, and a pull at the stretched arm asks for no more acceleration.
DEFAULT_SCALE_THRESHOLD: Final = 0.25


@dataclass(frozen=True)
class MinimumKineticEnergy(Formulation):
    r"""Least kinetic energy with the task as an equality, scaled down where it can't be met (thesis 3.1.5, MKE).

    .. math::
        \min_{\dot q,\,s}\ \tfrac12\,\dot q' M\,\dot q/\bar m + \tfrac12\,(2 - s)^2\,|v|^2/\sigma_0^2
        \quad\text{s.t.}\quad J_{free}\,\dot q = s\,v,\quad J_{fixed}\,\dot q = v_{fixed},\quad
        \dot q_{lo} \le \dot q \le \dot q_{hi},\quad 0 \le s \le 1

    with M(q) the joint-space inertia and :math:`\bar m = \mathrm{tr} M/n_v` its mean, which makes sigma_0 mean the same
    for a light arm and for a heavy one, and changes nothing about which of the motions it is. Unhindered, that is
    M^-1 J'(J M^-1 J')^-1 v, J being the guided and the locked rows (Khatib's dynamically consistent inverse, 1987).
    Scaling, and the form with ``task="hard"``, are those of `minimum-velocity-norm`.

    Robots whose masses are unknown are refused with a `RobotError`.

    Parameters
    ----------
    task : {"scaled", "hard"}
        See above.

    Run-time parameters
    -------------------
    scale_threshold : shape ()
        sigma_0 [m or rad], 0.25 unless told otherwise: the smallest singular value without loss of speed, of J in the
        norm of M over its mean.
    """

    task: Task = "scaled"

    name: ClassVar[str] = "minimum-kinetic-energy"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_task(self.task)

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        qd = qp.variable("qd", tick.nv)
        # M = L D L': with L' qd as residuals and D as weights nothing but sums of squares is declared, without roots.
        lower, pivots, _ = factor_of_positive(tick.M)
        qp.minimize(matmul(lower.T, qd), weight=pivots * (tick.nv / ca.trace(tick.M)), name="kinetic energy")
        if self.task == "hard":
            follow_exactly(qp, tick, qd)
        else:
            follow_scaled(qp, tick, qd, scale_threshold(tick, DEFAULT_SCALE_THRESHOLD))
            qp.feasible(qd=tick.qd_fixed)
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)
