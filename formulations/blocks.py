"""An affine expression taken apart by variable, for whoever writes a declaration down in another language."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from .program import Rows

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Affine:
    """An expression affine in the variables: the sum of `slopes[name]` times the variable of that name, plus `offset`.

    Attributes
    ----------
    slopes : dict of str to ca.SX, shapes (k, size of the variable)
        Those of the variables that it depends on, in the order of their declaration.
    offset : ca.SX, shape (k, 1)
    """

    slopes: dict[str, ca.SX]
    offset: ca.SX


def split(expression: ca.SX, variables: Mapping[str, ca.SX]) -> Affine:
    """Take an expression apart that is known to be affine in the variables, as `lower` makes sure of."""
    x = ca.vertcat(*variables.values())
    slopes = {name: ca.sparsify(ca.jacobian(expression, symbol)) for name, symbol in variables.items()}
    offset = ca.substitute(expression, x, ca.SX.zeros(x.size1(), 1))
    return Affine({name: slope for name, slope in slopes.items() if slope.nnz()}, offset)


def split_rows(rows: Rows, variables: Mapping[str, ca.SX]) -> Affine:
    """Take rows apart; both sides of an equality may hold variables: its rows then say slopes x + offset = 0."""
    return split(rows.expression - rows.lower if rows.upper is None else rows.expression, variables)


def constant(matrix: ca.SX) -> Array | None:
    """Numbers of a matrix that depends on no input; None if it does."""
    return np.array(ca.DM(matrix), dtype=float) if matrix.is_constant() else None


def multiple_of_identity(matrix: ca.SX) -> float | None:
    """Return c where a matrix is c times the identity, whatever the inputs; else None."""
    numbers = constant(matrix) if matrix.is_square() else None
    if numbers is None or not np.array_equal(numbers, numbers[0, 0] * np.eye(len(numbers))):
        return None
    return float(numbers[0, 0])


def is_diagonal(matrix: ca.SX) -> bool:
    """Whether a matrix is square and diagonal by structure."""
    return matrix.is_square() and bool(ca.sparsify(matrix).sparsity().is_diag())
