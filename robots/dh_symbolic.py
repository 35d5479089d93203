"""The product of Denavit-Hartenberg matrices in letters, for people to read; what the arm computes with is `Robot`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy as sp

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .dh import DhRow


def dh_matrix(rows: Sequence[DhRow], names: Sequence[str] | None = None, *, unit: float = 1.0) -> Any:
    """
    Multiply the matrices of DH rows symbolically.

    Parameters
    ----------
    rows
        As of `robot_from_dh`.
    names
        Letters of the joint positions; None for the rows' names. A prismatic joint's is in `unit`, too.
    unit
        What lengths are expressed in [m]: 1e-3 for millimetres.

    Returns
    -------
    `sympy.Matrix` of shape (4, 4). Angles that are multiples of 15 degrees and lengths are exact; entries are expanded
    no further than the product of the matrices.

    Raises
    ------
    ValueError
        If there are not as many names as rows.
    """
    letters = [row.name for row in rows] if names is None else list(names)
    if len(letters) != len(rows):
        raise ValueError(f"names: expected {len(rows)}, got {len(letters)}")
    product = sp.eye(4)
    for row, letter in zip(rows, letters, strict=True):
        position = sp.Symbol(letter, real=True)
        theta, d = _angle(row.theta), _length(row.d, unit)
        if row.kind == "revolute":
            theta += position
        else:
            d += position
        product = product * _single(theta, d, _length(row.a, unit), _angle(row.alpha))
    return product


def _single(theta: Any, d: Any, a: Any, alpha: Any) -> Any:
    turn = sp.Matrix([[sp.cos(theta), -sp.sin(theta)], [sp.sin(theta), sp.cos(theta)]])
    ca, sa = sp.cos(alpha), sp.sin(alpha)
    x, y = turn[:, 0], turn[:, 1]
    return sp.Matrix(
        [
            [x[0], y[0] * ca, -y[0] * sa, a * x[0]],
            [x[1], y[1] * ca, -y[1] * sa, a * x[1]],
            [0, sa, ca, d],
            [0, 0, 0, 1],
        ]
    )


def _angle(value: float) -> Any:
    """A multiple of 15 degrees exactly, any other angle as it is."""
    twelfths = value * 12.0 / float(sp.pi)
    near = round(twelfths)
    return sp.Rational(near, 12) * sp.pi if abs(twelfths - near) < 1e-12 else sp.Float(value)


def _length(value: float, unit: float) -> Any:
    return sp.nsimplify(value / unit, rational=True, tolerance=1e-12)
