"""`joint-space`: the thesis's second formulation, joint velocities as variables and the mode as equalities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from .base import Formulation

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

# docs/joint-weight.md measures 1e-8 to 1e-1: smaller makes the QP so flat that solvers lose digits, larger
# takes too much off the hand's speed.
DEFAULT_JOINT_WEIGHT: Final = 1e-4


@dataclass(frozen=True)
class JointSpace(Formulation):
    r"""Cartesian error against joint speed, the mode as an equality (thesis 4.5.4, eq. 4.47-4.50, table 4.2).

    .. math::
        \min_{\varepsilon, \dot q}\ \tfrac12\,\varepsilon' W \varepsilon + \tfrac12\,\dot q' W_q \dot q
        \quad\text{s.t.}\quad J_{free}\,\dot q - \varepsilon = v,\quad J_{fixed}\,\dot q = v_{fixed},\quad
        \dot q_{lo} \le \dot q \le \dot q_{hi}

    Uses self-motion, so that its Cartesian error is never larger than that of `cartesian-error` but for what the joint
    weight costs. It inverts nothing and has no protection at singularities.

    Run-time parameters
    -------------------
    task_weight : shape (m_free,)
        W's diagonal, 1 unless told otherwise.
    joint_weight : shape (nv,)
        W_q's diagonal [m^2 or rad^2 per unit of joint velocity], `DEFAULT_JOINT_WEIGHT` unless told otherwise.
    """

    name: ClassVar[str] = "joint-space"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        eps = qp.variable("eps", tick.m_free)
        qd = qp.variable("qd", tick.nv)
        task_weight = tick.parameter("task_weight", 1.0, size=tick.m_free, lowest=0.0, positive=True)
        joint_weight = tick.parameter("joint_weight", DEFAULT_JOINT_WEIGHT, size=tick.nv, lowest=0.0, positive=True)
        qp.minimize(eps, weight=task_weight, name="Cartesian error")
        qp.minimize(qd, weight=joint_weight, name="joint speed")
        qp.equal(tick.J_free @ qd - eps, tick.v, name="task")
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)
        qp.feasible(eps=tick.J_free @ tick.qd_fixed - tick.v, qd=tick.qd_fixed)
