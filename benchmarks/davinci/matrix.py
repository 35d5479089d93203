"""A_8^12 in letters, compared with the report's table 2 entry by entry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp

from ...robots.davinci5 import DAVINCI5_ROWS
from ...robots.dh_symbolic import dh_matrix
from .document import LETTERS, TABLE_2

#: Millimetres, as in the report.
_UNIT = 1e-3


@dataclass(frozen=True)
class Entry:
    """One entry of A_8^12.

    Attributes
    ----------
    row, column : int
        From 1.
    ours, printed, difference : sympy expression
        The product of the DH matrices, the report's, and printed minus ours, simplified.
    """

    row: int
    column: int
    ours: Any
    printed: Any
    difference: Any

    @property
    def same(self) -> bool:
        """Whether the two are the same function of the joint positions."""
        return bool(self.difference == 0)


def compare_matrix() -> tuple[Entry, ...]:
    """Compare all 16 entries, by symbolic simplification."""
    ours = dh_matrix(DAVINCI5_ROWS, LETTERS, unit=_UNIT)
    symbols = {letter: sp.Symbol(letter, real=True) for letter in LETTERS}
    entries = []
    for row in range(4):
        for column in range(4):
            printed = sp.sympify(TABLE_2[row][column], locals=symbols)
            difference = sp.simplify(sp.expand(printed - ours[row, column]))
            entries.append(Entry(row + 1, column + 1, ours[row, column], printed, difference))
    return tuple(entries)


_NAMES = {"th8": r"\theta_{8}", "d9": "d_{9}", "th10": r"\theta_{10}", "th11": r"\theta_{11}", "th12": r"\theta_{12}"}


def to_latex(expression: Any) -> str:
    """LaTeX with the joints as Greek letters with indices."""
    return str(sp.latex(expression, symbol_names={sp.Symbol(name, real=True): tex for name, tex in _NAMES.items()}))


def to_mathml(expression: Any) -> str:
    """Presentation MathML, which browsers draw without help."""
    greek = {
        sp.Symbol(name, real=True): sp.Symbol(name.replace("th", "theta_").replace("d9", "d_9"), real=True)
        for name in _NAMES
    }
    drawn = sp.mathml(sp.sympify(expression).subs(greek), printer="presentation")
    return f"<math>{drawn}</math>"


def matrix_latex() -> str:
    """The whole of A_8^12 as LaTeX, lengths in millimetres."""
    return "A_8^{12} = " + to_latex(dh_matrix(DAVINCI5_ROWS, LETTERS, unit=_UNIT))
