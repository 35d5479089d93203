"""From the canonical QP to the one that the generated C solves: what equalities define is substituted, symbolically."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from ..formulations import DATA

if TYPE_CHECKING:
    from ..formulations import Lowered

_UNIT: Final = (1.0, -1.0)


@dataclass(frozen=True)
class Reduced:
    """minimise 1/2 x'Hx + g'x  subject to  A x = b,  lower <= C x <= upper; command K x + k.

    Attributes
    ----------
    H, g : ca.SX, shapes (n, n), (n, 1)
        Cost.
    A, b : ca.SX, shapes (m_eq, n), (m_eq, 1)
        The equalities that define no variable; their rank may change from tick to tick.
    C, lower, upper : ca.SX, shapes (m, n), (m, 1), (m, 1)
        All two-sided rows: those of C, then the bounded variables.
    K, k : ca.SX, shapes (nv, n), (nv, 1)
        Command.
    start : ca.SX, shape (n, 1) or (0, 1)
        The declared feasible point, if there is one.
    rows : tuple of str
        Names of the rows.
    """

    H: ca.SX
    g: ca.SX
    A: ca.SX
    b: ca.SX
    C: ca.SX
    lower: ca.SX
    upper: ca.SX
    K: ca.SX
    k: ca.SX
    start: ca.SX
    rows: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of variables."""
        return int(self.g.size1())

    @property
    def m_eq(self) -> int:
        """Number of equalities."""
        return int(self.b.size1())

    @property
    def m(self) -> int:
        """Number of rows."""
        return int(self.lower.size1())

    @property
    def diagonal(self) -> bool:
        """Whether H is diagonal whatever the inputs, so that nothing needs to be factorised."""
        return all(self.H[i, j].is_zero() for i in range(self.n) for j in range(self.n) if i != j)


def reduce(lowered: Lowered) -> Reduced:
    """Substitute the variables that an equality defines.

    Those are unbounded, appear in no other equality, and stand there with a constant +-1 in front, like the Cartesian
    error of `joint-space`.

    Parameters
    ----------
    lowered : Lowered
        What to reduce.
    """
    data = dict(zip(DATA, lowered.function(*lowered.symbols), strict=True))
    data = {name: ca.sparsify(ca.SX(value)) for name, value in data.items()}
    kept, T, t, A, b = _substitute(data)
    HT = data["H"] @ T
    bounded = [j for j, name in enumerate(lowered.rows.box) if name]
    offset = ca.vertcat(data["C"] @ t, _rows(t, bounded))
    start = data["x_feasible"]
    return Reduced(
        # Each pair of entries by one formula: CasADi doesn't see that the other one's gives the same.
        H=ca.sparsify(ca.triu2symm(ca.triu(T.T @ HT))),
        g=ca.sparsify(T.T @ (data["H"] @ t + data["g"])),
        A=A,
        b=b,
        C=ca.sparsify(ca.vertcat(data["C"] @ T, _rows(T, bounded))),
        lower=ca.vertcat(data["l"], _rows(data["lb"], bounded)) - offset,
        upper=ca.vertcat(data["u"], _rows(data["ub"], bounded)) - offset,
        K=ca.sparsify(data["K"] @ T),
        k=ca.sparsify(data["K"] @ t + data["k"]),
        start=_rows(start, kept) if start.size1() else ca.SX(0, 1),
        rows=(*lowered.rows.inequalities, *(name for name in lowered.rows.box if name)),
    )


def _substitute(data: dict[str, ca.SX]) -> tuple[list[int], ca.SX, ca.SX, ca.SX, ca.SX]:
    """Substitute what equalities define: x = T x[kept] + t, and the equalities A x[kept] = b that remain."""
    A, b, n = data["A"], data["b"], data["g"].size1()
    free = [_infinite(data["lb"][j]) and _infinite(data["ub"][j]) for j in range(n)]
    definitions: dict[int, int] = {}
    for i in range(A.size1()):
        for j in range(n):
            entry = A[i, j]
            alone = all(A[other, j].is_zero() for other in range(A.size1()) if other != i)
            if free[j] and alone and entry.is_constant() and float(entry) in _UNIT and j not in definitions:
                definitions[j] = i
                break
    kept = [j for j in range(n) if j not in definitions]
    T, t = ca.SX(n, len(kept)), ca.SX(n, 1)
    for column, j in enumerate(kept):
        T[j, column] = 1
    for j, i in definitions.items():
        sign = float(A[i, j])
        T[j, :] = -A[i, kept] / sign
        t[j] = b[i] / sign
    # A definition that mentions another defined variable can't occur: each stands in its own row alone.
    left = [i for i in range(A.size1()) if i not in definitions.values()]
    return kept, T, t, _rows(A, left)[:, kept], _rows(b, left)


def _rows(matrix: ca.SX, indices: list[int]) -> ca.SX:
    """Pick rows; CasADi takes no rows of a 1 x 1 matrix for something else."""
    return matrix[indices, :] if indices else ca.SX(0, matrix.size2())


def _infinite(value: ca.SX) -> bool:
    return bool(value.is_constant()) and bool(np.isinf(float(value)))
