"""The constraints of a QP as other libraries want them, ``A x = b`` and ``G x <= h``, and the way back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .solver import BackendError

if TYPE_CHECKING:
    import numpy.typing as npt

    from .qp import QP
    from .validation import Array


class OneSided:
    """Which rows of ``qp.stacked`` become equalities and which sides become rows of G, for one structure.

    Coinciding sides, of rows as of the box, become equalities; absent sides are left out.

    Parameters
    ----------
    qp
        A problem with the structure.
    box
        Whether the box stays apart. Otherwise its sides are rows of G, too.
    """

    def __init__(self, qp: QP, *, box: bool) -> None:
        rows = qp.m_eq + qp.m_ineq
        fixed = qp.lower == qp.upper
        free = ~fixed
        self._pinned = fixed[rows:]
        if box:
            free[rows:] = False
        upper = np.flatnonzero(np.isfinite(qp.upper) & free)
        lower = np.flatnonzero(np.isfinite(qp.lower) & free)
        self._equal = np.flatnonzero(fixed)
        # Row i of G is sign[i] times row source[i] of qp.stacked, and h[i] is sign[i] times entry side[i] of
        # [upper; lower].
        self._source = np.concatenate((upper, lower))
        self._side = np.concatenate((upper, len(fixed) + lower))
        self._sign = np.repeat([1.0, -1.0], (len(upper), len(lower)))

    @property
    def equalities(self) -> int:
        """Number of rows of A."""
        return len(self._equal)

    @property
    def inequalities(self) -> int:
        """Number of rows of G."""
        return len(self._source)

    def rows(self, qp: QP) -> tuple[Array, Array, Array, Array]:
        """Return A, b, G and h; new arrays that may be written to."""
        G = qp.stacked[self._source] * self._sign[:, None]
        h = np.concatenate((qp.upper, qp.lower))[self._side] * self._sign
        return qp.stacked[self._equal], qp.lower[self._equal], G, h

    def box(self, qp: QP) -> tuple[Array, Array]:
        """Return the box without the variables that it pins, which are in A; new arrays."""
        return np.where(self._pinned, -np.inf, qp.lb), np.where(self._pinned, np.inf, qp.ub)

    def multipliers(
        self, qp: QP, y: npt.ArrayLike, z: npt.ArrayLike, z_box: npt.ArrayLike = 0.0
    ) -> tuple[Array, Array, Array]:
        """Return y, z and z_box of the QP from the multipliers of A, G (not negative) and the box (signed)."""
        # Both sides of a row add up in its one multiplier. With weights bincount adds floats, which its stubs do not
        # know; the conversion copies nothing.
        weights = self._sign * np.asarray(z, dtype=np.float64)
        total = np.bincount(self._source, weights, len(qp.lower)).astype(np.float64, copy=False)
        total[self._equal] += np.asarray(y, dtype=np.float64)
        rows = qp.m_eq + qp.m_ineq
        total[rows:] += np.asarray(z_box, dtype=np.float64)
        return total[: qp.m_eq], total[qp.m_eq : rows], total[rows:]


def require_numbers(qp: QP) -> None:
    """Refuse NaN and an infinite cost, with which some libraries run forever or crash."""
    finite = np.isfinite(qp.H).all() and np.isfinite(qp.g).all() and np.isfinite(qp.stacked).all()
    if not finite or np.isnan(qp.lower).any() or np.isnan(qp.upper).any():
        raise BackendError("The problem holds NaN or infinity, and is not passed on.")
