"""`geometric-clamping`: what drives a joint over its bound is taken out of the hand's velocity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from .base import Baseline, Promise, Resolved
from .critical_directions import critical_directions
from .linear import factor

if TYPE_CHECKING:
    import casadi as ca

    from ..formulations import Tick
    from .situation import Situation


@dataclass(frozen=True)
class GeometricClamping(Baseline):
    r"""What drives a joint over its bound is taken out of the hand's velocity (thesis 4.4.1, eq. 4.14-4.18).

    The i-th row of the inverse of the guided rows is joint i's critical direction. If the joint would exceed its bound,
    the hand's velocity loses its part along that direction,

    .. math:: \dot x_d = \dot x_{d\parallel} + \dot x_{d\perp},\qquad \dot x_f = \dot x_{d\perp}

    which stops the joint, and lets the hand move on in the plane that is left. With several such joints it is what is
    perpendicular to all their directions; joints that exceed their bounds after that are added, until none does or no
    direction is left. A joint stops at once where its bound begins to hold it, not at its limit.
    """

    name: ClassVar[str] = "geometric-clamping"
    promises: ClassVar[frozenset[Promise]] = frozenset({"joint bounds", "locked rows"})

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:  # noqa: ARG002  # rows and bounds are all it needs
        """Nothing."""
        return {}

    def resolve(self, at: Situation) -> Resolved:
        """Compute the command."""
        directions = critical_directions(at)
        held = np.zeros(at.nv)
        velocity = directions.wanted
        for _ in range(at.nv + 1):
            qd = directions.command(velocity)
            worst = directions.most_critical(at, qd, held)
            if worst is None:
                break
            held[worst] = 1.0 if qd[worst] > at.qd_hi[worst] else -1.0
            null = factor(directions.inverse[held != 0.0]).null
            velocity = null @ (null.T @ directions.wanted)
        return Resolved(qd, 1 + int(np.count_nonzero(held)), held)
