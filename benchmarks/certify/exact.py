"""Integers in place of doubles: every double is one, times a power of two, so nothing here is ever rounded."""

from __future__ import annotations

from math import gcd, isqrt
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    Form = tuple[int, ...]
    Matrix = list[list[int]]

# Digits of a reciprocal length, in bits: lengths are irrational, and this is as near as they are taken.
_LENGTH_BITS: Final = 120


def integers(values: NDArray[np.float64]) -> tuple[NDArray[np.object_], int]:
    """Give integers n and an exponent e with values = n / 2^e, to the last bit.

    Raises
    ------
    ValueError
        When a value isn't finite.
    """
    if not np.isfinite(values).all():
        raise ValueError(f"expected finite values, got {values}")
    ratios = [float(value).as_integer_ratio() for value in values.ravel()]
    exponent = max((denominator.bit_length() - 1 for _, denominator in ratios), default=0)
    whole = np.empty(len(ratios), dtype=object)
    whole[:] = [numerator << (exponent - denominator.bit_length() + 1) for numerator, denominator in ratios]
    return whole.reshape(values.shape), exponent


def dot(a: Sequence[int], b: Sequence[int]) -> int:
    """Sum of products."""
    return sum(x * y for x, y in zip(a, b, strict=True))


def combined(weights: Sequence[int], forms: Sequence[Sequence[int]]) -> Form:
    """Weighted sum of forms, at least one."""
    return tuple(dot(weights, column) for column in zip(*forms, strict=True))


def reduced(form: Iterable[int]) -> Form:
    """Divide a form by the greatest common divisor of its entries: the same condition, by shorter numbers."""
    entries = tuple(form)
    common = gcd(*entries)
    return tuple(entry // common for entry in entries) if common > 1 else entries


def adjugate(matrix: Matrix) -> tuple[Matrix, int]:
    """Adjugate and determinant, by Faddeev and LeVerrier: all divisions come out even."""
    size = len(matrix)
    if not size:
        return [], 1
    step = [[int(i == j) for j in range(size)] for i in range(size)]
    for k in range(1, size + 1):
        product = [[dot(row, column) for column in zip(*step, strict=True)] for row in matrix]
        coefficient = -sum(product[i][i] for i in range(size)) // k
        if k == size:
            # Of A B = -coefficient I, up to the sign that B carries.
            sign = 1 if size % 2 else -1
            return [[sign * entry for entry in row] for row in step], -sign * coefficient
        step = [[product[i][j] + (coefficient if i == j else 0) for j in range(size)] for i in range(size)]
    raise AssertionError("unreachable")


def null_vector(columns: Sequence[Sequence[int]]) -> Form | None:
    """Give the one combination, up to its length, that makes columns zero; None if there is none or more than one."""
    count = len(columns)
    rows = [list(row) for row in zip(*columns, strict=True)]
    pivots: list[int] = []
    last = 1
    for column in range(count):
        at = len(pivots)
        found = next((i for i in range(at, len(rows)) if rows[i][column]), None)
        if found is None:
            continue
        rows[at], rows[found] = rows[found], rows[at]
        pivot = rows[at][column]
        # Bareiss, on the rows above too: what is left is diagonal, and all divisions come out even.
        for i, row in enumerate(rows):
            if i != at:
                factor = row[column]
                rows[i] = [(pivot * x - factor * y) // last for x, y in zip(row, rows[at], strict=True)]
        last = pivot
        pivots.append(column)
    if len(pivots) != count - 1:
        return None
    free = next(column for column in range(count) if column not in pivots)
    weights = [0] * count
    weights[free] = last
    for at, column in enumerate(pivots):
        weights[column] = -rows[at][free]
    return reduced(weights)


def reciprocal_lengths(squares: Sequence[int]) -> list[int]:
    """1 / sqrt of each, 0 for 0, all times the same power of two; relatively exact to 2^-120."""
    bits = max(squares).bit_length() // 2 + _LENGTH_BITS + 2
    return [isqrt((1 << (2 * bits)) // square) if square else 0 for square in squares]


def direction(form: Sequence[int]) -> NDArray[np.float64]:
    """Give a form at length 1 in floating point; zeros where it is zero."""
    largest = max(abs(entry) for entry in form)
    if not largest:
        return np.zeros(len(form))
    scaled = np.array([entry / largest for entry in form])  # integers may be too large for a float, quotients aren't
    unit: NDArray[np.float64] = scaled / np.linalg.norm(scaled)
    return unit
