"""Pseudo-inverses with a stated rank tolerance, and prioritised tasks, by singular values."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.linalg import lapack

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# A singular value below this share of the norm of the matrix before it was projected adds no rank. What it drops of a
# locked row is ten times below what the locked rows promise (1e-9), as in `kinqp.formulations.inverse`.
RANK_TOLERANCE: Final = 1e-10


@dataclass(frozen=True)
class Factors:
    """Singular values of a matrix, those within `RANK_TOLERANCE` dropped: M = U diag(sigma) V'.

    Attributes
    ----------
    U, sigma, V : ndarray, shapes (m, r), (r,), (n, r)
    null : ndarray, shape (n, n - r)
        Orthonormal basis of the null space.
    """

    U: Array
    sigma: Array
    V: Array
    null: Array

    @property
    def rank(self) -> int:
        """Number of singular values that count."""
        return len(self.sigma)

    def smallest(self) -> float | None:
        """Smallest singular value of M, where M has full row rank; otherwise it may have been dropped."""
        return float(self.sigma[-1]) if 0 < len(self.U) == self.rank else None

    def solve(self, rhs: Array) -> Array:
        """Least-norm least-squares solution M^+ `rhs`, shape (n,)."""
        solution: Array = self.V @ ((self.U.T @ rhs) / self.sigma)
        return solution

    def reachable(self, rhs: Array) -> Array:
        """Part of `rhs`, shape (m,), that lies in the range of M."""
        part: Array = self.U @ (self.U.T @ rhs)
        return part


def factor(matrix: Array, scale: float | None = None) -> Factors:
    """Decompose a matrix.

    Parameters
    ----------
    matrix : ndarray, shape (m, n)
        Either may be zero.
    scale : float, optional
        What singular values are small against; the largest of them, if not given. For a projected matrix it is the
        size before the projection, beside which nothing but rounding may be left.
    """
    m, n = matrix.shape
    if not m or not n:
        return Factors(np.zeros((m, 0)), np.zeros(0), np.zeros((n, 0)), np.eye(n))
    # What numpy.linalg.svd calls, without what it does around it: twice as fast for matrices of a dozen entries.
    U, sigma, Vt, info = lapack.dgesdd(matrix)
    if info:
        raise np.linalg.LinAlgError(f"expected a matrix with singular values, got {matrix} (dgesdd: {info})")
    size = float(sigma[0]) if scale is None else scale
    # A handful of numbers, in falling order: a loop in Python is faster than NumPy's.
    rank = sum(value > RANK_TOLERANCE * size for value in sigma.tolist()) if size > 0.0 else 0
    return Factors(U[:, :rank], sigma[:rank], Vt[:rank].T, Vt[rank:].T)


def size_of(matrix: Array) -> float:
    """Largest singular value's upper bound, the Frobenius norm; zero for an empty matrix."""
    entries = matrix.ravel()
    return sqrt(entries @ entries)


@dataclass(frozen=True)
class Prioritised:
    """Where a list of tasks leads.

    Attributes
    ----------
    qd : ndarray, shape (nv,)
        Joint velocity [rad/s or m/s].
    null : ndarray, shape (nv, d)
        Orthonormal basis of the motions that no task sees.
    factors : tuple of Factors
        Of each task's rows, in the null space of those before it.
    """

    qd: Array
    null: Array
    factors: tuple[Factors, ...]


def prioritise(tasks: Iterable[tuple[Array, Array]], basis: Array) -> Prioritised:
    r"""Any number of tasks in strict order of priority (thesis eq. 3.2, 4.1).

    .. math:: \dot q_i = \dot q_{i-1} + (J_i P^A_{i-1})^\dagger (\dot x_i - J_i\,\dot q_{i-1})

    With Z an orthonormal basis of the null space that the tasks before leave, :math:`P^A = Z Z'` and
    :math:`(J P^A)^\dagger = Z (J Z)^\dagger`: written so, no task moves one before it however close to a singularity
    its own inverse is.

    Parameters
    ----------
    tasks : iterable of (J, xd), shapes (m_i, nv) and (m_i,)
        First priority first.
    basis : ndarray, shape (nv, k)
        Orthonormal basis of the joint velocities to choose from: the identity, or its columns of the joints that are
        not frozen.
    """
    qd, Z = np.zeros(len(basis)), basis
    found: list[Factors] = []
    for J, xd in tasks:
        factors = factor(J @ Z, size_of(J))
        qd = qd + Z @ factors.solve(xd - J @ qd)
        Z = Z @ factors.null
        found.append(factors)
    return Prioritised(qd, Z, tuple(found))


def largest_scale(start: Array, change: Array, lower: Array, upper: Array) -> float:
    """Largest alpha in [0, 1] with `start` + alpha `change` within its bounds, if `start` is (thesis eq. 4.13).

    Parameters
    ----------
    start, change, lower, upper : ndarray, shape (nv,)
    """
    end = start + change
    over = (end > upper) | (end < lower)
    if not over.any():
        return 1.0
    room = np.where(change > 0.0, upper, lower)[over] - start[over]
    return float(np.clip(np.min(room / change[over]), 0.0, 1.0))
