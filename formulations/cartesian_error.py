"""`cartesian-error`: the thesis's first formulation, in the error of the guided rows alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from .base import Formulation
from .inverse import rounding_of_inverse

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick


@dataclass(frozen=True)
class CartesianError(Formulation):
    r"""Smallest Cartesian error within the joint velocity bounds (thesis 4.5.2, eq. 4.32-4.37).

    .. math::
        \min_\varepsilon\ \tfrac12\,\varepsilon' W \varepsilon \quad\text{s.t.}\quad
        \dot q_{lo} - \dot q_d \le J^\# \varepsilon \le \dot q_{hi} - \dot q_d

    with :math:`\dot q_d = J^\# v` and command :math:`\dot q = J^\#(v + \varepsilon)`. With drift correction
    (`v_fixed`) both carry the joint velocity that gives the locked rows theirs, and the guided rows make up for it.

    Self-motion is out of its reach: the command stays in the range of J#. Zero motion, :math:`\varepsilon = -v`, is
    always feasible while `v_fixed` is zero. The thesis stacks [J#; -J#]; two-sided rows are the same problem. Bounds
    are widened by what J#'s rounding makes of the hand, 1e-13 of its speed (`rounding_of_inverse`).

    Run-time parameters
    -------------------
    task_weight : shape (m_free,)
        W's diagonal, 1 unless told otherwise.
    damping_threshold, damping_max
        See `kinqp.formulations.robust_inverse`.
    """

    name: ClassVar[str] = "cartesian-error"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        eps = qp.variable("eps", tick.m_free)
        weight = tick.parameter("task_weight", 1.0, size=tick.m_free, lowest=0.0, positive=True)
        qp.minimize(eps, weight=weight, name="Cartesian error")
        qd_d, known = tick.qd_task, rounding_of_inverse(tick.v_left)
        qp.between(tick.qd_lo - known - qd_d, tick.inverse @ eps, tick.qd_hi + known - qd_d, name="joint limits")
        qp.command(qd_d + tick.inverse @ eps)
        qp.feasible(eps=-tick.v_left)
