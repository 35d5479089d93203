"""`geometric-scaling`: what drives a joint over its bound is scaled down, the rest of the hand's velocity kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from .base import Baseline, Promise, Resolved
from .critical_directions import OVER, critical_directions
from .linear import factor, largest_scale

if TYPE_CHECKING:
    import casadi as ca

    from ..formulations import Tick
    from .situation import Situation

# Joints of boundary planes that meet are at their bounds to this much [rad/s or m/s]; if not, the planes are parallel.
_MEET: Final = 1e-9


@dataclass(frozen=True)
class GeometricScaling(Baseline):
    r"""What drives a joint over its bound is scaled down, the rest kept (thesis 4.4.2, 4.4.3, eq. 4.19-4.25).

    A joint's bound is a plane of guided velocities, perpendicular to the joint's critical direction. If the joint would
    exceed it, the part of the hand's velocity along that direction is scaled so that it ends on the plane,

    .. math::
        \dot x_f = \alpha\,\dot x_{d\parallel} + \dot x_{d\perp},\qquad \alpha = \dot Q_{max,i}/\dot q_i

    (eq. 4.19 is printed the other way round; a factor in [0, 1] is limit over demand, as in eq. 4.13). With several
    such joints, the most critical one first, it is the point where their planes meet that is closest to the hand's
    velocity; joints that exceed their bounds after that are added, until none does. As the thesis says, this does not
    always work: planes can be parallel, and the point where they meet need not be the best. In the first case the whole
    task is scaled by the common factor of eq. 4.13; the second is left as it is: the QP `cartesian-error` is what
    solves both.
    """

    name: ClassVar[str] = "geometric-scaling"
    promises: ClassVar[frozenset[Promise]] = frozenset({"joint bounds", "locked rows"})

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:  # noqa: ARG002  # rows and bounds are all it needs
        """Nothing."""
        return {}

    def resolve(self, at: Situation) -> Resolved:
        """Compute the command."""
        directions = critical_directions(at)
        whole = directions.command(directions.wanted)
        held = np.zeros(at.nv)
        qd = whole
        for iteration in range(1, at.nv + 2):
            worst = directions.most_critical(at, qd, held)
            if worst is None:
                return Resolved(qd, iteration, held)
            held[worst] = 1.0 if qd[worst] > at.qd_hi[worst] else -1.0
            chosen = held != 0.0
            excess = whole - np.where(held > 0.0, at.qd_hi, at.qd_lo)
            back = factor(directions.inverse[chosen]).solve(excess[chosen])
            qd = directions.command(directions.wanted - back)
            if np.max(at.over(qd)[chosen]) > _MEET:
                break
        change = whole - directions.resting
        scale = largest_scale(directions.resting, change, at.qd_lo, at.qd_hi)
        slowed = directions.resting + scale * change
        blocking = (at.over(whole) > 0.0) & (at.over(slowed, -OVER) > 0.0)
        return Resolved(slowed, iteration, np.where(blocking, np.sign(change), 0.0))
