"""Joint bounds seen from the hand: each is a plane in the space of the guided velocities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from .linear import factor, prioritise, size_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .situation import Situation

    Array = NDArray[np.float64]

# A joint this little above its bound is at it [rad/s or m/s]: it is rounding.
OVER: Final = 1e-12


@dataclass(frozen=True)
class CriticalDirections:
    """The inverse of the guided rows, its rows being the joints' critical directions (thesis eq. 4.14).

    Attributes
    ----------
    inverse : ndarray, shape (nv, m_free)
        (J_free N_c)^+, the thesis's invJ; it never moves the locked rows.
    resting : ndarray, shape (nv,)
        What drift compensation asks for, zero if nothing; bounds count from there [rad/s or m/s].
    wanted : ndarray, shape (m_free,)
        What is left for the hand [m/s, rad/s].
    """

    inverse: Array
    resting: Array
    wanted: Array

    def command(self, velocity: Array) -> Array:
        """Joint velocity for a guided velocity, shape (nv,)."""
        command: Array = self.resting + self.inverse @ velocity
        return command

    def most_critical(self, at: Situation, qd: Array, held: Array) -> int | None:
        """Joint, not among those `held`, that needs the smallest alpha (limit over demand); None if all fit."""
        over = (held == 0.0) & (at.over(qd, OVER) > 0.0)
        if not over.any():
            return None
        demand = np.where(over, qd - self.resting, 1.0)
        return int(np.argmin(np.where(over, (at.nearest(qd) - self.resting) / demand, np.inf)))


def critical_directions(at: Situation) -> CriticalDirections:
    """Work them out at a state."""
    fixed = prioritise(at.tasks[:1], np.eye(at.nv))
    factors = factor(at.J_free @ fixed.null, size_of(at.J_free))
    inverse = fixed.null @ (factors.V / factors.sigma) @ factors.U.T
    return CriticalDirections(inverse, fixed.qd, at.v - at.J_free @ fixed.qd)
