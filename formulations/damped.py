"""`damped`: Cartesian error and damped joint velocities in one sum, in the joint velocities alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from .base import Formulation

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

DEFAULT_DAMPING: Final = 2.5e-3


@dataclass(frozen=True)
class Damped(Formulation):
    r"""Damped least squares under the mode's equalities (shared-control drilling robot, "Convex Optimization").

    .. math::
        \min_{\dot q}\ \tfrac12\,|J_{free}\,\dot q - v|^2 + \tfrac{\lambda}{2}\,|\dot q|^2
        \quad\text{s.t.}\quad S'J\,\dot q = e,\quad \dot q_{lo} \le \dot q \le \dot q_{hi}

    S selects the locked rows of the twist and e is their drift correction, here `v_fixed`; on rows that an equality
    fixes the document's residual is a constant, so that only the guided ones are left in it. Zero motion is feasible.

    The same minimum as `joint-space` with joint_weight = lambda and task_weight = 1, but with the joint velocities as
    the only variables and a dense Hessian J'J + lambda I. Unhindered, no joint moves faster than
    :math:`|v|/(2\sqrt\lambda)`, at a singularity either: at that price the share :math:`\lambda/(\sigma^2 + \lambda)`
    of the hand's speed is lost along a direction with singular value sigma. The document leaves lambda open.

    Run-time parameters
    -------------------
    damping : shape ()
        lambda [m^2 or rad^2], `DEFAULT_DAMPING` unless told otherwise: the square of the 0.05 that `cartesian-error`
        has at a singularity, which bounds joint speeds to 10 rad/s per m/s.
    """

    name: ClassVar[str] = "damped"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        qd = qp.variable("qd", tick.nv)
        damping = tick.parameter("damping", DEFAULT_DAMPING, lowest=0.0, positive=True, unit="m^2 or rad^2")
        qp.minimize(tick.J_free @ qd - tick.v, name="Cartesian error")
        qp.minimize(qd, weight=damping, name="damping")
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)
        qp.feasible(qd=tick.qd_fixed)
