"""One task, and all those before it, under joint bounds: the passes of saturation in the null space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from .linear import Factors, factor, size_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# A joint this little above its bound is at it [rad/s or m/s]: it is rounding.
OVER: Final = 1e-12


@dataclass(frozen=True)
class Level:
    """Where a task leads under bounds.

    Attributes
    ----------
    qd : ndarray, shape (nv,)
        Joint velocity [rad/s or m/s].
    scale : float
        Share of the task that is done, in [0, 1].
    held : ndarray, shape (nv,)
        +1 where a joint is saturated at its upper bound, -1 at its lower one, 0 elsewhere.
    iterations : int
        Passes.
    """

    qd: Array
    scale: float
    held: Array
    iterations: int


@dataclass(frozen=True)
class Problem:
    """A task in the null space of those before it, under bounds.

    The task is to change J qd from what it is at `start` by the scale times `wanted`, without touching the tasks before
    it: whatever the scale, `start` itself is feasible at 0.

    Attributes
    ----------
    J : ndarray, shape (m, nv)
        The task's rows.
    wanted : ndarray, shape (m,)
        xd - J start, as far as the null space reaches it [m/s, rad/s].
    start : ndarray, shape (nv,)
        What the tasks before it lead to [rad/s or m/s].
    Z : ndarray, shape (nv, k)
        Orthonormal basis of the motions that these do not see.
    factors : Factors
        Of J Z.
    lower, upper : ndarray, shape (nv,)
        Bounds [rad/s or m/s].
    """

    J: Array
    wanted: Array
    start: Array
    Z: Array
    factors: Factors
    lower: Array
    upper: Array

    @staticmethod
    def state(J: Array, xd: Array, start: Array, Z: Array, bounds: tuple[Array, Array]) -> Problem:
        """Make one for the task J qd = `xd`, leaving out of it what is out of reach at a singularity."""
        factors = factor(J @ Z, size_of(J))
        return Problem(J, factors.reachable(xd - J @ start), start, Z, factors, *bounds)

    @property
    def left(self) -> Array:
        """Orthonormal basis of the motions that neither this task nor those before it see."""
        left: Array = self.Z @ self.factors.null
        return left


def saturate(problem: Problem) -> Level:
    r"""Saturate the most critical joint in the null space until the task fits (thesis 3.1.7, eq. 3.9).

    Pass by pass, with the saturated joints S at their bounds and Z' the rest of the null space that leaves them there,
    :math:`\dot q(s) = b + s\,a` is the least-norm way to do the task at scale s (eq. 3.9, in the form for several tasks
    of Flacco, De Luca, Khatib, IROS 2012). If it fits at s = 1, done. If not, the scale that fits is noted if it is the
    largest yet, and the joint that would need the smallest one is saturated. When that leaves too little rank for the
    task, or cannot be done, the largest scale noted is the answer, and zero scale if there is none.

    The scale found is not always the largest there is: saturated joints are never released. `saturate_optimally` is.
    """
    p = problem
    scale_of_J = size_of(p.J)
    held = np.zeros(len(p.start))
    best = Level(p.start, 0.0, held, 1)
    for iteration in range(1, len(p.start) + 2):
        chosen = held != 0.0
        if iteration == 1:
            a, b = p.Z @ p.factors.solve(p.wanted), p.start
        else:
            bound = np.where(held > 0.0, p.upper, p.lower)
            saturating = factor(p.Z[chosen], 1.0)
            task = factor(p.J @ p.Z @ saturating.null, scale_of_J)
            if saturating.rank < int(chosen.sum()) or task.rank < p.factors.rank:
                break
            rest = p.start + p.Z @ saturating.solve((bound - p.start)[chosen])
            to_task = p.Z @ saturating.null
            a = to_task @ task.solve(p.wanted)
            b = rest + to_task @ task.solve(p.J @ (p.start - rest))
        over = np.where(chosen, 0.0, np.maximum(a + b - p.upper, p.lower - a - b) - OVER)
        if not (over > 0.0).any():
            return Level(a + b, 1.0, held, iteration)
        low, high = _fitting_scales(a, b, p, chosen)
        least = max(0.0, float(low.max()))
        most = min(1.0, float(high.min()))
        if least <= most and most > best.scale:
            at_bound = held + np.where(chosen | (high > most), 0.0, np.where(a > 0.0, 1.0, -1.0))
            best = Level(b + most * a, most, at_bound, iteration)
        critical = int(np.argmin(np.where(over > 0.0, high, np.inf)))
        held = held.copy()
        held[critical] = 1.0 if (a + b)[critical] > p.upper[critical] else -1.0
    if best.scale > 0.0:
        return Level(best.qd, best.scale, best.held, iteration)
    # Nothing moves: held back by those that were to be saturated and are at their bounds already.
    blocked = np.minimum(p.upper - p.start, p.start - p.lower) <= OVER
    return Level(p.start, 0.0, np.where(blocked, held, 0.0), iteration)


def _fitting_scales(a: Array, b: Array, p: Problem, chosen: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Smallest and largest s, joint by joint, with b + s a within bounds; an empty interval where there is none."""
    moving = np.abs(a) > OVER
    slope = np.where(moving, a, 1.0)
    one, other = (p.lower - b) / slope, (p.upper - b) / slope
    inside = (b <= p.upper + OVER) & (b >= p.lower - OVER)
    low = np.where(moving, np.minimum(one, other), np.where(inside, -np.inf, np.inf))
    high = np.where(moving, np.maximum(one, other), np.where(inside, np.inf, -np.inf))
    return np.where(chosen, -np.inf, low), np.where(chosen, np.inf, high)
