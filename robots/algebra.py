"""
Three-dimensional vectors of symbolic scalars that drop zeros and ones as they meet them.

A scalar is a Python float or a 1x1 `casadi.SX`; floats are constants of the robot. CasADi would drop 0 * x
too, but only after a call into it, and it would carry the constant on as an expression.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Sequence

#: A float or a 1x1 `casadi.SX`; Any, since both take part in the same arithmetic.
Scalar: TypeAlias = Any
Vector: TypeAlias = tuple[Scalar, Scalar, Scalar]
#: Columns, not rows: columns are the axes of a frame, and it is those that are turned and read.
Columns: TypeAlias = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)
IDENTITY: Columns = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def vector(values: Any) -> Vector:
    """Return three array entries as floats."""
    x, y, z = values
    return float(x), float(y), float(z)


def columns(matrix: Any) -> Columns:
    """Return the columns of a (3, 3) array as floats."""
    return vector(matrix[:, 0]), vector(matrix[:, 1]), vector(matrix[:, 2])


def _is(value: Scalar, constant: float) -> bool:
    return isinstance(value, float) and value == constant


def times(a: Scalar, b: Scalar) -> Scalar:
    """Return a * b, without an operation where one of them is 0, 1 or -1."""
    if _is(a, 0.0) or _is(b, 0.0):
        return 0.0
    if _is(a, 1.0):
        return b
    if _is(b, 1.0):
        return a
    if _is(a, -1.0):
        return -b
    if _is(b, -1.0):
        return -a
    return a * b


def plus(a: Scalar, b: Scalar) -> Scalar:
    """Return a + b, without an operation where one of them is 0."""
    if _is(a, 0.0):
        return b
    if _is(b, 0.0):
        return a
    return a + b


def minus(a: Scalar, b: Scalar) -> Scalar:
    """Return a - b, without an operation where b is 0."""
    if _is(b, 0.0):
        return a
    if _is(a, 0.0):
        return -b
    return a - b


def add(a: Vector, b: Vector) -> Vector:
    """Return the vector a + b."""
    return plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])


def subtract(a: Vector, b: Vector) -> Vector:
    """Return the vector a - b."""
    return minus(a[0], b[0]), minus(a[1], b[1]), minus(a[2], b[2])


def scale(a: Vector, factor: Scalar) -> Vector:
    """Return the vector a * factor."""
    return times(a[0], factor), times(a[1], factor), times(a[2], factor)


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Return the scalar product of two sequences of equal length."""
    total: Scalar = 0.0
    for x, y in zip(a, b, strict=True):
        total = plus(total, times(x, y))
    return total


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product a x b."""
    return (
        minus(times(a[1], b[2]), times(a[2], b[1])),
        minus(times(a[2], b[0]), times(a[0], b[2])),
        minus(times(a[0], b[1]), times(a[1], b[0])),
    )


def apply(matrix: Columns, a: Vector) -> Vector:
    """Return matrix @ a."""
    x, y, z = (tuple(column[row] for column in matrix) for row in range(3))
    return dot(x, a), dot(y, a), dot(z, a)


def apply_transposed(matrix: Columns, a: Vector) -> Vector:
    """Return matrix.T @ a."""
    return dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)


def compose(left: Columns, right: Columns) -> Columns:
    """Return left @ right."""
    return apply(left, right[0]), apply(left, right[1]), apply(left, right[2])


def turn_z(cosine: Scalar, sine: Scalar, a: Vector) -> Vector:
    """Return `a` turned about z by the angle with this cosine and sine."""
    return (
        minus(times(cosine, a[0]), times(sine, a[1])),
        plus(times(sine, a[0]), times(cosine, a[1])),
        a[2],
    )
