"""What a QP's structure tells whatever its numbers: what the generated code may leave out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca

if TYPE_CHECKING:
    from .reduction import Reduced


@dataclass(frozen=True)
class Shape:
    """What is known of a mode's QP whatever the numbers, and saves work in its code.

    Attributes
    ----------
    diagonal : bool
        H is diagonal and there is neither gradient nor equality: without rows the answer is zero.
    gradient : bool
        There is a gradient.
    start : bool
        A feasible point was declared.
    direct_rows : bool
        Row i bounds variable i and nothing else.
    direct_command : bool
        The command is x itself.
    same : bool
        The command moves with x as the rows do: K = C.
    """

    diagonal: bool
    gradient: bool
    start: bool
    direct_rows: bool
    direct_command: bool
    same: bool

    @classmethod
    def of(cls, reduced: Reduced) -> Shape:
        """Look at a QP."""
        gradient = not reduced.g.is_zero()
        one = ca.SX.eye(reduced.n)
        return cls(
            diagonal=reduced.diagonal and not gradient and not reduced.m_eq,
            gradient=gradient,
            start=bool(reduced.start.size1()),
            direct_rows=identical(reduced.C, one),
            direct_command=identical(reduced.K, one) and reduced.k.is_zero(),
            same=identical(reduced.K, reduced.C),
        )


def identical(a: ca.SX, b: ca.SX) -> bool:
    """Tell whether two expressions are one, as far as CasADi knows that their difference is zero."""
    return a.shape == b.shape and bool((a - b).is_zero())
