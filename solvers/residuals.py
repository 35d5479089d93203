"""How far a point and its multipliers are from solving a QP, measured the same way for every solver."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .qp import QP
    from .validation import Array


# The method `max` goes through a Python wrapper that costs more than the reduction itself at this size.
_max = np.maximum.reduce

_TINY = 1e-300


@dataclass(frozen=True, slots=True)
class Residuals:
    """Violations of the optimality conditions, absolute and scaled; infinite where numbers are not finite.

    The scaled values do not change when a row of A or C, or the whole objective, is multiplied by a number,
    so that a wrong answer cannot hide behind small units:

    - ``primal_scaled``: the violation of row c'x, divided by ``|c|'(1 + |x|)``; of the box, by ``1 + |x_j|``; of a row
      of zeros, as it is.
    - ``dual_scaled``: ``dual`` divided by the gradient's size, the largest entry of |H|, |Hx|, |g| and
      |A'y + C'z + z_box|.
    - ``gap_scaled``: ``gap`` divided by the gradient's size times ``1 + max|x|``.

    What they do not bound is the distance to the minimiser: where the smallest curvature is s, a gap of d
    still allows ``|x - x*| <= sqrt(2 d / s)``.

    Parameters
    ----------
    primal
        Largest violation of equalities, rows and box.
    dual
        Largest entry of ``H x + g + A'y + C'z + z_box``, where a multiplier that pushes on an absent side
        counts as 0.
    gap
        Absolute difference of the primal and the dual objective,
        ``x'Hx + g'x + b'y + sum(upper max(z, 0)) - sum(lower max(-z, 0))``, box included.
    primal_scaled, dual_scaled, gap_scaled
        The same, relative.
    """

    primal: float
    dual: float
    gap: float
    primal_scaled: float
    dual_scaled: float
    gap_scaled: float

    @property
    def worst(self) -> float:
        """Largest of the absolute residuals."""
        return max(self.primal, self.dual, self.gap)

    @property
    def worst_scaled(self) -> float:
        """Largest of the scaled residuals, the number by which a solution is judged."""
        return max(self.primal_scaled, self.dual_scaled, self.gap_scaled)


def residuals(qp: QP, x: Array, y: Array, z: Array, z_box: Array) -> Residuals:
    """Measure how well a point and its multipliers satisfy the optimality conditions of a QP.

    Parameters
    ----------
    qp
        The problem.
    x
        Point, shape (n,).
    y, z, z_box
        Multipliers of A, C and the box, shapes (m_eq,), (m_ineq,) and (n,).
    """
    # Written with few NumPy calls on the stacked constraints, because this runs after every solve in a
    # control loop. Overflow and NaN are answers here: they end as an infinite residual, below.
    with np.errstate(all="ignore"):
        H, g, stacked = qp.H, qp.g, qp.stacked
        size = np.abs(x) + 1.0
        activity = stacked.dot(x)
        violation = np.maximum(activity - qp.upper, qp.lower - activity)
        # A row of zeros has no unit, and no x changes it: it counts absolutely. Its bound may carry rounding.
        scale = np.abs(stacked).dot(size)
        scale[scale < _TINY] = 1.0
        kept, support = effective_multipliers(qp, np.concatenate((y, z, z_box)))
        pull = kept.dot(stacked)
        Hx = H.dot(x)
        slope = Hx + g
        gradient = _largest(np.concatenate((Hx, g, pull, H.ravel()))) or 1.0

        primal = float(_max(violation, initial=0.0))
        dual = _largest(slope + pull)
        gap = abs(float(x.dot(slope)) + support)
        primal_scaled = float(_max(violation / scale, initial=0.0))
        gap_scaled = gap / (gradient * float(_max(size)))
    if not isfinite(primal + dual + gap + primal_scaled + gap_scaled):
        return Residuals(inf, inf, inf, inf, inf, inf)
    return Residuals(primal, dual, gap, primal_scaled, dual / gradient, gap_scaled)


def effective_multipliers(qp: QP, multipliers: Array) -> tuple[Array, float]:
    """Drop multipliers that push on an absent side, and sum up the bounds that the rest push on.

    Parameters
    ----------
    qp
        The problem.
    multipliers
        ``[y; z; z_box]``, in the order of ``qp.stacked``, shape (m_eq + m_ineq + n,).

    Returns
    -------
    tuple
        The multipliers that count, same shape, and ``sum(upper max(z, 0)) - sum(lower max(-z, 0))`` over all
        of them.
    """
    side = np.where(multipliers > 0.0, qp.upper, qp.lower)
    absent = np.isinf(side)
    kept = multipliers.copy()
    side[absent] = kept[absent] = 0.0
    return kept, float(kept.dot(side))


def _largest(vector: Array) -> float:
    return float(_max(np.abs(vector)))
