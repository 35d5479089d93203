"""The null space of the locked rows, and the singularity-robust inverse of the guided rows within it.

Source: thesis 4.2 (task priority, eq. 4.1-4.3); damping after Nakamura and Hanafusa (1986), but of the task part
alone, so that the locked rows hold exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import casadi as ca

# A locked row whose part outside the span of the rows before it is smaller than this (relative) adds no direction:
# dropping it leaves an error of at most this much in that row, ten times below what the locked rows promise (1e-9).
DEPENDENT_ROW: Final = 1e-10
# Entries of a projected row smaller than this (relative to the row) are rounding.
ROUNDING: Final = 1e-12


@dataclass(frozen=True)
class FixedRows:
    """Orthonormal factors of the locked rows, J_fixed = L U, dependent rows dropped.

    Attributes
    ----------
    basis : ca.SX, shape (m_fixed, nv)
        U: orthonormal rows; a dependent row of J_fixed leaves a zero row here.
    lower : ca.SX, shape (m_fixed, m_fixed)
        L: lower triangular; the diagonal entry of a dropped row is zero.
    """

    basis: ca.SX
    lower: ca.SX

    def project(self, rows: ca.SX) -> ca.SX:
        """Take out of `rows`, shape (k, nv), what lies in the span of the locked rows: `rows` N_c.

        Entries that are nothing but rounding become zero. A joint that can't take part in the motion would otherwise
        get a tiny coefficient of random sign, and, resting on its limit, block half of all directions with it.
        """
        left = rows - (rows @ self.basis.T) @ self.basis
        noise = ROUNDING * ca.sqrt(ca.sum2(rows * rows))
        return ca.if_else(ca.fabs(left) > ca.repmat(noise, 1, rows.size2()), left, 0)

    def solve(self, v_fixed: ca.SX) -> ca.SX:
        """Smallest joint velocity, shape (nv, 1), with J_fixed qd = `v_fixed`, (m_fixed, 1), dropped rows aside."""
        along: list[ca.SX] = []
        for i in range(self.basis.size1()):
            rest = v_fixed[i] - sum((self.lower[i, j] * along[j] for j in range(i)), ca.SX(0))
            pivot = self.lower[i, i]
            along.append(ca.if_else(pivot > 0, rest / ca.if_else(pivot > 0, pivot, 1), 0))
        return self.basis.T @ ca.vertcat(*along)


def factor_fixed_rows(J_fixed: ca.SX) -> FixedRows:
    """Orthonormalise the locked rows by Gram-Schmidt, each row twice, dropping dependent ones.

    On the rows themselves, not on their Gram matrix: that would square the condition number and lose half the digits
    just where the rows become dependent. The second pass keeps the basis orthogonal to rounding however small the
    remainder, so that N_c = I - U'U is a projector to rounding as well.

    Parameters
    ----------
    J_fixed : ca.SX, shape (m_fixed, nv)
        Locked rows of the Jacobian [m/s or rad/s per rad/s or m/s].
    """
    m, nv = J_fixed.shape
    basis = ca.SX(0, nv)
    lower = ca.SX(m, m)
    for i in range(m):
        row = J_fixed[i, :]
        rest = row
        for _ in range(2 if i else 0):
            along = rest @ basis.T
            rest = rest - along @ basis
            lower[i, :i] += along
        size = ca.dot(rest, rest)
        kept = size > DEPENDENT_ROW**2 * ca.dot(row, row)
        norm = ca.sqrt(ca.if_else(kept, size, 1))
        basis = ca.vertcat(basis, ca.if_else(kept, rest / norm, 0))
        lower[i, i] = ca.if_else(kept, norm, 0)
    return FixedRows(basis, lower)


def robust_inverse(J_bar: ca.SX, threshold: ca.SX, damping_max: ca.SX) -> ca.SX:
    r"""Damped inverse J_bar' (J_bar J_bar' + lambda^2 I)^-1, equal to the pseudo-inverse away from singularities.

    With s a smooth lower estimate of the smallest singular value (`smallest_singular_value_estimate`),
    :math:`\lambda^2 = \lambda_{max}^2\,(1 - (s/\sigma_0)^2)^2` where :math:`s < \sigma_0`, and exactly zero elsewhere:
    continuous with its first derivative, and largest at the singularity, where the inverse is finite for that reason.

    Parameters
    ----------
    J_bar : ca.SX, shape (m, nv)
        Guided rows within the null space of the locked ones, J_free N_c.
    threshold : ca.SX, scalar
        sigma_0: below it damping sets in, in the units of J_bar's singular values (mixed m and rad as they are).
    damping_max : ca.SX, scalar
        lambda_max, at the singularity; the same units.

    Returns
    -------
    ca.SX, shape (nv, m)
        J#.
    """
    gram = J_bar @ J_bar.T
    s2 = smallest_singular_value_estimate(gram) ** 2
    weakness = ca.fmax(1 - s2 / threshold**2, 0)
    damping2 = (damping_max * weakness) ** 2
    return _solve_positive(gram + damping2 * ca.SX.eye(gram.size1()), J_bar).T


def smallest_singular_value_estimate(gram: ca.SX) -> ca.SX:
    r"""Smooth lower estimate of the smallest singular value of J from G = J J', shape (m, m).

    :math:`s = \|G^{-1}\|_F^{-1/2}` lies between :math:`\sigma_{min}/m^{1/4}` and :math:`\sigma_{min}`; unlike the
    singular value itself it has derivatives where two singular values meet.
    """
    m = gram.size1()
    # A shift far below any threshold in use keeps the inverse finite at the singularity itself.
    shift = 1e-12 * ca.trace(gram) + 1e-100
    inverse = _solve_positive(gram + shift * ca.SX.eye(m), ca.SX.eye(m))
    return 1 / ca.sqrt(ca.sqrt(ca.sumsqr(inverse)))


def _solve_positive(matrix: ca.SX, rhs: ca.SX) -> ca.SX:
    """Solve a symmetric positive definite system by LDL' without pivoting, unrolled."""
    m = matrix.size1()
    lower = ca.SX.eye(m)
    pivots: list[ca.SX] = []
    for j in range(m):
        pivots.append(matrix[j, j] - sum((lower[j, k] ** 2 * pivots[k] for k in range(j)), ca.SX(0)))
        for i in range(j + 1, m):
            rest = matrix[i, j] - sum((lower[i, k] * lower[j, k] * pivots[k] for k in range(j)), ca.SX(0))
            lower[i, j] = rest / pivots[j]
    rows = [rhs[i, :] for i in range(m)]
    for i in range(m):
        for k in range(i):
            rows[i] = rows[i] - lower[i, k] * rows[k]
    rows = [row / pivot for row, pivot in zip(rows, pivots, strict=True)]
    for i in reversed(range(m)):
        for k in range(i + 1, m):
            rows[i] = rows[i] - lower[k, i] * rows[k]
    return ca.vertcat(*rows)
