"""Small dense linear algebra on symbols, arranged for short chains of dependent operations.

A processor works on several independent operations at once, so what straight-line code of this size costs is the length
of its longest chain. CasADi sums products one after another; here they are summed in a tree.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

if TYPE_CHECKING:
    from collections.abc import Sequence


def balanced_sum(terms: Sequence[ca.SX]) -> ca.SX:
    """Sum scalars in a tree; terms that are zero by structure are left out."""
    left = [term for term in terms if not term.is_zero()]
    if not left:
        return ca.SX(0)
    while len(left) > 1:
        pairs = [left[i] + left[i + 1] for i in range(0, len(left) - 1, 2)]
        left = pairs + left[2 * len(pairs) :]
    return left[0]


def dot(a: ca.SX, b: ca.SX) -> ca.SX:
    """Scalar product of two vectors of the same size, rows or columns."""
    return balanced_sum([a[i] * b[i] for i in range(a.numel())])


def matmul(A: ca.SX, B: ca.SX) -> ca.SX:
    """Matrix product, shape (p, r) from (p, q) and (q, r)."""
    p, r = A.size1(), B.size2()
    product = ca.SX(p, r)
    rows, columns = [A[i, :] for i in range(p)], [B[:, j] for j in range(r)]
    for i in range(p):
        for j in range(r):
            entry = dot(rows[i], columns[j])
            if not entry.is_zero():
                product[i, j] = entry
    return product


def factor_of_positive(matrix: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Factor a symmetric positive definite matrix, shape (m, m), into L D L' without pivoting, unrolled.

    Returns
    -------
    lower : ca.SX, shape (m, m)
        L, unit lower triangular.
    pivots, reciprocals : ca.SX, shape (m, 1)
        Diagonal of D, and one over it.
    """
    m = matrix.size1()
    lower = ca.SX.eye(m)
    scaled: list[list[ca.SX]] = []  # columns of L D, kept so that each entry is divided once
    reciprocals: list[ca.SX] = []
    for j in range(m):
        column = [
            matrix[i, j] - balanced_sum([lower[i, k] * scaled[k][j] for k in range(j)]) if i >= j else ca.SX(0)
            for i in range(m)
        ]
        reciprocals.append(1 / column[j])
        scaled.append(column)
        for i in range(j + 1, m):
            lower[i, j] = column[i] * reciprocals[j]
    # scaled[j][j] is the pivot of column j.
    return lower, ca.vertcat(*(scaled[j][j] for j in range(m))), ca.vertcat(*reciprocals)


def inverse_of_positive(matrix: ca.SX) -> ca.SX:
    """Inverse of a symmetric positive definite matrix, shape (m, m), by L D L' without pivoting, unrolled.

    Cofactors have shorter chains for m = 3, but measured no faster, and lose all digits where two singular values
    vanish.
    """
    m = matrix.size1()
    lower, _, reciprocals = factor_of_positive(matrix)
    rows = [ca.SX.eye(m)[i, :] for i in range(m)]
    for i in range(m):
        for k in range(i):
            rows[i] = rows[i] - lower[i, k] * rows[k]
    rows = [row * reciprocals[i] for i, row in enumerate(rows)]
    for i in reversed(range(m)):
        for k in range(i + 1, m):
            rows[i] = rows[i] - lower[k, i] * rows[k]
    return ca.vertcat(*rows)
