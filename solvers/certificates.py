"""Proofs that a QP has no solution, and how to check them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .residuals import effective_multipliers

if TYPE_CHECKING:
    from .qp import QP
    from .validation import Array

#: How sharp a proof must be, see the two functions below. Backends stop at about 1e-9.
CERTIFICATE_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class FarkasCertificate:
    """Multipliers that contradict the constraints (Farkas' lemma); fields as in `Solution`."""

    y: Array
    z: Array
    z_box: Array

    def proves(self, qp: QP, tol: float = CERTIFICATE_TOLERANCE) -> bool:
        """Whether this shows that `qp` is primal infeasible."""
        return is_primal_infeasibility_certificate(qp, self.y, self.z, self.z_box, tol)


@dataclass(frozen=True, slots=True, eq=False)
class UnboundedRay:
    """A direction, shape (n,), in which the objective falls without end."""

    direction: Array

    def proves(self, qp: QP, tol: float = CERTIFICATE_TOLERANCE) -> bool:
        """Whether this shows that `qp` is unbounded, if it is feasible."""
        return is_dual_infeasibility_certificate(qp, self.direction, tol)


def is_primal_infeasibility_certificate(
    qp: QP, y: Array, z: Array, z_box: Array, tol: float = CERTIFICATE_TOLERANCE
) -> bool:
    """Check multipliers that claim to prove that no point satisfies the constraints of a QP.

    Let ``r = A'y + C'z + z_box`` and ``s = b'y + sum(upper max(z, 0)) - sum(lower max(-z, 0))``; then every
    feasible x has ``r'x <= s``. If s is negative, a feasible x would need ``|x|_1 >= -s / max|r|``: the
    certificate is accepted when this distance is at least ``1 / tol`` (infinite for an exact one).

    Parameters
    ----------
    qp
        The problem.
    y, z, z_box
        Multipliers of A, C and the box, shapes (m_eq,), (m_ineq,) and (n,); their common scale does not
        matter.
    tol
        Inverse of the distance within which no feasible point may exist.
    """
    with np.errstate(all="ignore"):
        kept, value = effective_multipliers(qp, np.concatenate((y, z, z_box)))
        residual = float(np.abs(kept @ qp.stacked).max())
    return bool(np.isfinite(value) and value < 0.0 and residual <= -value * tol)


def is_dual_infeasibility_certificate(qp: QP, direction: Array, tol: float = CERTIFICATE_TOLERANCE) -> bool:
    """Check a direction that claims to prove that the objective of a QP has no lower bound.

    The direction d must have no curvature (Hd = 0), descend (g'd < 0), keep the equalities (Ad = 0) and point
    away from every side that exists, each to `tol` relative to the size of d and of the data; in the variables as they
    are, or in units in which H has a unit diagonal or, where that is zero, the rows have unit columns. Where variables
    come in units that differ by much, sizes say something in the latter only.

    Parameters
    ----------
    qp
        The problem.
    direction
        Shape (n,); its length does not matter.
    tol
        Relative tolerance.
    """
    if not np.isfinite(direction).all() or not direction.any():
        return False
    return any(_is_ray(qp, direction, unit, tol) for unit in (np.ones(qp.n), _units(qp)))


def _is_ray(qp: QP, direction: Array, unit: Array, tol: float) -> bool:
    """Check a direction in variables of the given units, shape (n,)."""
    H, g, stacked, d = qp.H * np.outer(unit, unit), qp.g * unit, qp.stacked * unit, direction / unit
    d = d / np.abs(d).max()
    movement = stacked @ d
    slack = tol * np.abs(stacked).sum(axis=1)
    return bool(
        (np.abs(H @ d) <= tol * np.abs(H).max()).all()
        and g @ d < -tol * np.abs(g).max()
        and (movement <= slack)[np.isfinite(qp.upper)].all()
        and (movement >= -slack)[np.isfinite(qp.lower)].all()
    )


def _units(qp: QP) -> Array:
    """Units of the variables in which H has a unit diagonal or, where that is zero, the rows have unit columns."""
    curvature = np.diag(qp.H)
    rows = np.abs(qp.stacked[: qp.m_eq + qp.m_ineq])
    longest = rows.max(axis=1, initial=0.0)
    column = (rows / np.where(longest > 0.0, longest, 1.0)[:, None]).max(axis=0, initial=0.0)
    size = np.where(curvature > 0.0, np.sqrt(np.abs(curvature)), column)
    return 1.0 / np.where(size > 0.0, size, 1.0)
