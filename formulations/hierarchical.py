"""`hierarchical`: mode before task before posture, strictly, as a cascade of QPs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np

from .base import Formulation
from .hierarchy import Hierarchy, command_above

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick


@dataclass(frozen=True)
class Hierarchical(Hierarchy):
    r"""Mode and limits always, then the least Cartesian error, and of all motions that attain it the posture's choice.

    .. math::
        \text{task:}\quad & \min_{\dot q}\ \tfrac12\,(J_{free}\,\dot q - v)' W (J_{free}\,\dot q - v)
        \quad\text{s.t.}\quad J_{fixed}\,\dot q = v_{fixed},\quad \dot q_{lo} \le \dot q \le \dot q_{hi} \\
        \text{posture:}\quad & \min_{z}\ \tfrac12\,(\dot q^* + z - \dot q_p)' W_q\,(\dot q^* + z - \dot q_p)
        \quad\text{s.t.}\quad J_{free}\,z = 0,\quad J_{fixed}\,z = 0,\quad
        \dot q_{lo} \le \dot q^* + z \le \dot q_{hi}

    with :math:`\dot q^*` the task level's command and :math:`\dot q_p = k\,(q_p - q)`. Thesis 3.1.2 has the order of
    priority without limits (eq. 3.2); with limits at every level it is the cascade of Kanoun, Lamiraux and Wieber
    (T-RO 2011). What is left to a level is written as a motion z in the null space of the levels above, which z = 0
    satisfies without rounding, so that no level makes the next one infeasible.

    It is what `joint-space` tends to as its joint weight goes to zero, without that weight's share of the task and
    its flat QPs' loss of digits: the task level has many minimisers, and the posture level picks one. Nothing protects
    from singularities: pulled outwards at the stretched arm the LBR's joints chatter between their bounds. Generated C
    solves both levels by the general solver that `make_step` uses: slower than the C of a single QP.

    Run-time parameters
    -------------------
    task_weight : shape (m_free,)
        W's diagonal, 1 unless told otherwise.
    joint_weight : shape (nv,)
        W_q's diagonal, 1 unless told otherwise.
    posture : shape (nv,)
        q_p [rad or m]; unless told otherwise the middle of each joint's range, 0 for one without limits.
    posture_gain : shape ()
        k [1/s], 0 unless told otherwise: the least motion, and an arm that rests when the hand does.
    """

    name: ClassVar[str] = "hierarchical"

    @property
    def levels(self) -> tuple[Formulation, ...]:
        """Task, posture."""
        return HierarchicalTask(self.bounds), HierarchicalPosture(self.bounds)


@dataclass(frozen=True)
class HierarchicalTask(Formulation):
    """The upper level of `Hierarchical`; its command is one of many with the same Cartesian error."""

    name: ClassVar[str] = "task"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        # Without eps as a variable: where the task can be met in full it would be rounding, and so would all that the
        # solver has to measure its answer against.
        qd = qp.variable("qd", tick.nv)
        weight = tick.parameter("task_weight", 1.0, size=tick.m_free, lowest=0.0, positive=True)
        qp.minimize(tick.J_free @ qd - tick.v, weight=weight, name="Cartesian error")
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)
        qp.feasible(qd=tick.qd_fixed)


@dataclass(frozen=True)
class HierarchicalPosture(Formulation):
    """The lower level of `Hierarchical`; takes the upper one's command as the run-time input `qd_above`."""

    name: ClassVar[str] = "posture"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        z = qp.variable("z", tick.nv)
        above = command_above(tick)
        weight = tick.parameter("joint_weight", 1.0, size=tick.nv, lowest=0.0, positive=True)
        posture = tick.parameter("posture", _middle(tick), size=tick.nv, unit="rad or m")
        gain = tick.parameter("posture_gain", 0.0, lowest=0.0, unit="1/s")
        qp.minimize(above + z - gain * (posture - tick.q), weight=weight, name="posture")
        qp.equal(tick.J_free @ z, 0, name="task")
        qp.equal(tick.J_fixed @ z, 0, name="mode")
        # The level above keeps the limits to its solver's tolerance; staying where it is must remain allowed.
        qp.between(ca.fmin(tick.qd_lo - above, 0), z, ca.fmax(tick.qd_hi - above, 0), name="joint limits")
        qp.command(above + z)
        qp.feasible(z=0)


def _middle(tick: Tick) -> np.ndarray:
    low, high = tick.robot.q_min, tick.robot.q_max
    limited = np.isfinite(low) & np.isfinite(high)
    return np.where(limited, 0.5 * (np.where(limited, low, 0.0) + np.where(limited, high, 0.0)), 0.0)
