"""LaTeX for a declaration: quantities of the tick are recognised, all else gets a letter and an entry in a legend."""

from __future__ import annotations

from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from ..robots import RobotError
from .blocks import constant, multiple_of_identity, split, split_rows
from .tick import Tick
from .tick_inputs import TickInputs

if TYPE_CHECKING:
    from .lowering import Lowered
    from .program import Cost, Rows, Term

_LATEX: Final = {
    "eps": r"\varepsilon",
    "qd": r"\dot q",
    "qdd": r"\ddot q",
    "J_free": r"J_{\mathrm{free}}",
    "J_fixed": r"J_{\mathrm{fixed}}",
    "J_bar": r"\bar J",
    "inverse": r"J^{\#}",
    "v_fixed": r"v_{\mathrm{fixed}}",
    "qd_lo": r"\dot q_{\mathrm{lo}}",
    "qd_hi": r"\dot q_{\mathrm{hi}}",
    "qdd_lo": r"\ddot q_{\mathrm{lo}}",
    "qdd_hi": r"\ddot q_{\mathrm{hi}}",
    "qd_max": r"\dot q_{\mathrm{max}}",
    "qdd_max": r"\ddot q_{\mathrm{max}}",
    "qd_prev": r"\dot q_{\mathrm{prev}}",
    "qdd_prev": r"\ddot q_{\mathrm{prev}}",
    "qd_fixed": r"\dot q_{\mathrm{fixed}}",
    "Jdot_qd": r"\dot J \dot q",
}
# Expressions are compared this deep; the same quantity is the same node or a step away from it.
_DEPTH: Final = 2


class Notation:
    """LaTeX for the parts of a lowered formulation."""

    def __init__(self, lowered: Lowered) -> None:
        self._lowered: Final = lowered
        self._variables: Final = lowered.program.variables
        self._known: Final = _quantities(lowered)
        self._letters: Final[dict[str, tuple[ca.SX, list[str]]]] = {}

    @property
    def legend(self) -> list[tuple[str, ...]]:
        """Of the letters given so far: symbol, what it stands for, shape, whether it changes."""
        lines: list[tuple[str, ...]] = []
        for symbol, (value, meanings) in self._letters.items():
            rows, columns = value.shape
            shape = f"{rows}" if columns == 1 else f"{rows} x {columns}"
            entries = "constant" if value.is_constant() else "change every tick"
            lines.append((f"${symbol}$", "; ".join(meanings), shape, entries))
        return lines

    def variable(self, name: str) -> str:
        """Write a variable's or quantity's name."""
        words = "text" if " " in name else "mathrm"
        return _LATEX.get(name) or (name if len(name) == 1 else rf"\{words}{{{self.text(name)}}}")

    def text(self, text: str) -> str:
        """Escape what LaTeX would take for something else."""
        return "".join(f"\\{letter}" if letter in r"_#%&{}$" else letter for letter in text)

    def term(self, term: Term) -> str:
        """Write 1/2 |r|^2_W."""
        inside = self._affine(term.residual, term.name)
        numbers = constant(term.weight)
        if numbers is not None and np.all(numbers == 1.0):
            return rf"\tfrac12 \lVert {inside} \rVert^2"
        return rf"\tfrac12 \lVert {inside} \rVert^2_{{{self._column(term.weight, 'W', f'weight of {term.name}')}}}"

    def cost(self, cost: Cost) -> str:
        """Write a linear cost."""
        slopes = split(cost.expression, self._variables).slopes
        return " + ".join(self._price(slope.T, name, cost.name) for name, slope in slopes.items()) or "0"

    def _price(self, column: ca.SX, variable: str, name: str) -> str:
        x, numbers = self.variable(variable), constant(column)
        if numbers is not None and np.all(numbers == numbers[0, 0]):
            ones = "" if numbers.size == 1 else r"1^\top "
            return rf"{numbers[0, 0]:g}\, {ones}{x}"
        return rf"{self._column(column, 'c', f'{name}, factor of {variable}')}^\top {x}"

    def rows(self, rows: Rows) -> str:
        """Write named rows."""
        parts = split_rows(rows, self._variables)
        left = self._sum(parts.slopes, rows.name) or "0"
        if rows.upper is None:
            return f"{left} = {self._column(-parts.offset, 'b', rows.name)}"
        lower, upper = (
            None if _infinite(side) else self._column(side - parts.offset, "b", f"{rows.name}, {word} side")
            for word, side in (("lower", rows.lower), ("upper", rows.upper))
        )
        return (rf"{lower} \le " if lower else "") + left + (rf" \le {upper}" if upper else "")

    def command(self) -> str:
        """Write what the robot is sent."""
        assert self._lowered.program.command_expression is not None  # noqa: S101  # lowering has refused it otherwise
        return self._affine(self._lowered.program.command_expression, "command")

    def _affine(self, expression: ca.SX, name: str) -> str:
        parts = split(expression, self._variables)
        left = self._sum(parts.slopes, name)
        if parts.offset.is_zero() and left:
            return left
        offset = self._column(parts.offset, "r", f"offset of {name}")
        return offset if not left else f"{left} - {offset[1:]}" if offset[0] == "-" else f"{left} + {offset}"

    def _sum(self, slopes: dict[str, ca.SX], name: str) -> str:
        products = [self._product(slope, variable, name) for variable, slope in slopes.items()]
        products.sort(key=lambda product: product.startswith("-"))
        return " + ".join(products).replace("+ -", "- ")

    def _product(self, slope: ca.SX, variable: str, name: str) -> str:
        x, factor = self.variable(variable), multiple_of_identity(slope)
        if factor is not None:
            return x if factor == 1.0 else f"-{x}" if factor == -1.0 else rf"{factor:g}\, {x}"
        known = self._recognise(slope)
        return rf"{known or self._letter('A', f'{name}, factor of {variable}', slope)} {x}"

    def _column(self, column: ca.SX, letter: str, meaning: str) -> str:
        numbers = constant(column)
        if numbers is not None and np.all(numbers == numbers[0, 0]):
            return f"{numbers[0, 0]:g}".replace("-inf", r"-\infty").replace("inf", r"\infty")
        return self._recognise(column) or self._letter(letter, meaning, column)

    def _recognise(self, value: ca.SX) -> str | None:
        for name, quantity in self._known.items():
            sign = _sign(value, quantity)
            if sign is not None:
                return sign + self.variable(name)
        return None

    def _letter(self, letter: str, meaning: str, value: ca.SX) -> str:
        alike = {symbol: known for symbol, known in self._letters.items() if symbol[0] == letter}
        for symbol, (known, meanings) in alike.items():
            sign = _sign(value, known)
            if sign is not None:
                meanings.append(sign + meaning)
                return sign + symbol
        symbol = f"{letter}_{{{len(alike) + 1}}}"
        self._letters[symbol] = (ca.densify(value), [meaning])
        return symbol


def _sign(value: ca.SX, known: ca.SX) -> str | None:
    """Give "" where two expressions are the same, "-" where one is the other's negative, None where neither."""
    dense = ca.densify(value)
    if dense.shape != known.shape:
        return None
    return "" if ca.is_equal(dense, known, _DEPTH) else "-" if ca.is_equal(-dense, known, _DEPTH) else None


def _quantities(lowered: Lowered) -> dict[str, ca.SX]:
    """Inputs and quantities of the tick, dense, by name."""
    found = {given.name: given.symbol for given in lowered.inputs}
    for name, attribute in (vars(TickInputs) | vars(Tick)).items():
        if not name.startswith("_") and isinstance(attribute, property | cached_property):
            with suppress(RobotError):  # an arm without inertias has no mass matrix
                quantity = getattr(lowered.tick, name)
                if isinstance(quantity, ca.SX) and quantity.numel():
                    found.setdefault(name, ca.densify(quantity))
    return {name: value for name, value in found.items() if not value.is_constant()}


def _infinite(side: ca.SX) -> bool:
    numbers = constant(side)
    return numbers is not None and bool(np.all(np.isinf(numbers)))
