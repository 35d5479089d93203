"""`null-space-compensation`: self-motion makes up for joints that are driven too fast."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from .base import Baseline, Promise, Resolved
from .linear import factor, largest_scale, prioritise

if TYPE_CHECKING:
    import casadi as ca

    from ..formulations import Tick
    from .situation import Situation

# A joint this little above its bound needs no compensation [rad/s or m/s]: it is rounding.
_OVER: Final = 1e-12


@dataclass(frozen=True)
class NullSpaceCompensation(Baseline):
    r"""Overdriven joints at their bounds, the task unchanged (thesis 3.1.6; Omrcen, Zlajpah, Nemec, Robotica 2007).

    With N the projector on what moves neither locked nor guided rows, and S the rows of the identity that pick the
    overdriven joints,

    .. math:: \dot q = \dot q_0 + N\,(S N)^\dagger\,S\,(\dot q_{bound} - \dot q_0)

    brings these to their bounds. It is possible if S N has full row rank. Joints that exceed their bounds after that
    are added to S, until none does. If the rank runs out, all joints are slowed down by a common factor (eq. 4.13),
    those of the last stage that could be computed, without the part that drift compensation asks for: **a joint resting
    on its limit that the task needs then stops the arm.**
    """

    name: ClassVar[str] = "null-space-compensation"
    promises: ClassVar[frozenset[Promise]] = frozenset({"joint bounds", "locked rows"})

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:  # noqa: ARG002  # rows and bounds are all it needs
        """Nothing."""
        return {}

    def resolve(self, at: Situation) -> Resolved:
        """Compute the command."""
        fixed = prioritise(at.tasks[:1], np.eye(at.nv)).qd
        first = prioritise(at.tasks, np.eye(at.nv))
        qd, Z = first.qd, first.null
        held = np.zeros(at.nv)
        for iteration in range(1, at.nv + 2):
            over = np.where(held == 0.0, at.over(qd, _OVER), 0.0) > 0.0
            if not over.any():
                return Resolved(qd, iteration, held)
            wanted = np.where(over, np.where(qd > at.qd_hi, 1.0, -1.0), held)
            chosen = wanted != 0.0
            factors = factor(Z[chosen], 1.0)
            if factors.rank < int(chosen.sum()):
                break
            bound = np.where(wanted > 0.0, at.qd_hi, at.qd_lo)
            qd, held = first.qd + Z @ factors.solve((bound - first.qd)[chosen]), wanted
        scale = largest_scale(fixed, qd - fixed, at.qd_lo, at.qd_hi)
        slowed = fixed + scale * (qd - fixed)
        # Those that the common factor left at their bounds.
        blocking = over & (at.over(slowed, -_OVER) > 0.0)
        return Resolved(slowed, iteration, np.where(blocking, np.sign(qd - fixed), held * (scale == 1.0)))
