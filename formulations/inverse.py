"""The null space of the locked rows, and the singularity-robust inverse of the guided rows within it.

Source: thesis 4.2 (task priority, eq. 4.1-4.3); damping after Nakamura and Hanafusa (1986), but of the task part
alone, so that the locked rows hold exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import casadi as ca

from .algebra import balanced_sum, dot, inverse_of_positive, matmul

# A locked row whose part outside the span of the rows before it is smaller than this (relative) adds no direction:
# dropping it leaves an error of at most this much in that row, ten times below what the locked rows promise (1e-9).
DEPENDENT_ROW: Final = 1e-10
# Entries of a projected row smaller than this (relative to the row) are rounding.
ROUNDING: Final = 1e-12
# Of J#: 1e-16 in J_bar, times 1/lambda_max^2 = 400, and a digit for what comes before.
INVERSE_ROUNDING: Final = 1e-13
# No hand is so fast that bounds are widened by more [rad/s or m/s]: a tenth of what a command may be outside of them.
WIDEST: Final = 1e-9


@dataclass(frozen=True)
class FixedRows:
    """Orthonormal factors of the locked rows, J_fixed = L U, dependent rows dropped.

    Attributes
    ----------
    basis : ca.SX, shape (m_fixed, nv)
        U: orthonormal rows; a dependent row of J_fixed leaves a zero row here.
    lower : ca.SX, shape (m_fixed, m_fixed)
        L: lower triangular; the diagonal entry of a dropped row is zero.
    reciprocals : tuple of ca.SX
        1 / L_ii, or zero where row i was dropped.
    """

    basis: ca.SX
    lower: ca.SX
    reciprocals: tuple[ca.SX, ...]

    def project(self, rows: ca.SX) -> ca.SX:
        """Take out of `rows`, shape (k, nv), what lies in the span of the locked rows: `rows` N_c.

        Entries that are nothing but rounding become zero. A joint that can't take part in the motion would otherwise
        get a tiny coefficient of random sign, and, resting on its limit, block half of all directions with it.
        """
        left = rows - matmul(matmul(rows, self.basis.T), self.basis)
        noise = ROUNDING**2 * ca.vertcat(*(dot(rows[i, :], rows[i, :]) for i in range(rows.size1())))
        return ca.if_else(left * left > ca.repmat(noise, 1, rows.size2()), left, 0)

    def solve(self, v_fixed: ca.SX) -> ca.SX:
        """Smallest joint velocity, shape (nv, 1), with J_fixed qd = `v_fixed`, (m_fixed, 1), dropped rows aside."""
        along: list[ca.SX] = []
        for i, reciprocal in enumerate(self.reciprocals):
            rest = v_fixed[i] - balanced_sum([self.lower[i, j] * along[j] for j in range(i)])
            along.append(rest * reciprocal)
        return matmul(self.basis.T, ca.vertcat(*along))

    def solve_transposed(self, direction: ca.SX) -> ca.SX:
        """Combination z, shape (m_fixed, 1), of the locked rows that makes up `direction`, (nv, 1), as far as it can.

        z' J_fixed = `direction`' J_fixed^+ J_fixed; the entries of dropped rows are zero.
        """
        along = matmul(self.basis, direction)
        m = along.size1()
        z = ca.SX(m, 1)
        for i in reversed(range(m)):
            z[i] = (along[i] - balanced_sum([self.lower[j, i] * z[j] for j in range(i + 1, m)])) * self.reciprocals[i]
        return z


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
    reciprocals: list[ca.SX] = []
    for i in range(m):
        row = J_fixed[i, :]
        rest = row
        for _ in range(2 if i else 0):
            along = matmul(rest, basis.T)
            rest = rest - matmul(along, basis)
            lower[i, :i] += along
        size = dot(rest, rest)
        kept = size > DEPENDENT_ROW**2 * dot(row, row)
        reciprocals.append(ca.if_else(kept, 1 / ca.sqrt(ca.if_else(kept, size, 1)), 0))
        basis = ca.vertcat(basis, rest * reciprocals[-1])
        lower[i, i] = size * reciprocals[-1]
    return FixedRows(basis, lower, tuple(reciprocals))


def robust_inverse(J_bar: ca.SX, threshold: ca.SX, damping_max: ca.SX) -> ca.SX:
    r"""Damped inverse J_bar' (J_bar J_bar' + lambda^2 I)^-1, equal to the pseudo-inverse away from singularities.

    With s a smooth lower estimate of the smallest singular value (`squared_singular_value_estimate`),
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
    gram = matmul(J_bar, J_bar.T)
    weakness = ca.fmax(1 - squared_singular_value_estimate(gram) / threshold**2, 0)
    damping2 = (damping_max * weakness) ** 2
    return matmul(J_bar.T, inverse_of_positive(gram + damping2 * ca.SX.eye(gram.size1())))


def squared_singular_value_estimate(gram: ca.SX) -> ca.SX:
    r"""Smooth lower estimate s^2 of the squared smallest singular value of J from G = J J', shape (m, m).

    :math:`s = \|G^{-1}\|_F^{-1/2}` lies between :math:`\sigma_{min}/m^{1/4}` and :math:`\sigma_{min}`; unlike the
    singular value itself it has derivatives where two singular values meet.
    """
    m = gram.size1()
    # A shift far below any threshold in use keeps the inverse finite at the singularity itself.
    shift = 1e-12 * ca.trace(gram) + 1e-100
    inverse = inverse_of_positive(gram + shift * ca.SX.eye(m))
    return 1 / ca.sqrt(balanced_sum([entry**2 for entry in ca.vertsplit(ca.vec(inverse))]))


def rounding_of_inverse(motion: ca.SX) -> ca.SX:
    """How well J# times `motion`, shape (m, 1), is known, scalar [rad/s or m/s]: what to widen bounds on it by.

    Where two joints move only together, their rows of J# are parallel but for rounding. With both on a limit, on
    opposite sides, the rows leave a plane of directions; taken as exact, rounding blocks half of that plane.
    """
    size = balanced_sum([ca.fabs(motion[i]) for i in range(motion.numel())])
    return ca.fmin(INVERSE_ROUNDING * size, WIDEST)
