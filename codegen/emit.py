"""Straight-line C from a CasADi SX function, one statement per instruction, no memory but its arguments."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING, Final

import casadi as ca

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence


class EmitError(ValueError):
    """An expression uses an operation that has no C counterpart here; the message names it."""


# Operation -> C expression of its operands. Comparisons give 0.0 or 1.0 as CasADi's do.
_OPERATIONS: Final[dict[int, str]] = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {0}",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_SIN: "sin({0})",
    ca.OP_COS: "cos({0})",
    ca.OP_TAN: "tan({0})",
    ca.OP_ASIN: "asin({0})",
    ca.OP_ACOS: "acos({0})",
    ca.OP_ATAN: "atan({0})",
    ca.OP_ATAN2: "atan2({0}, {1})",
    ca.OP_EXP: "exp({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_POW: "pow({0}, {1})",
    ca.OP_CONSTPOW: "pow({0}, {1})",
    ca.OP_TANH: "tanh({0})",
    ca.OP_FABS: "fabs({0})",
    ca.OP_FLOOR: "kinqp_floor({0})",
    ca.OP_CEIL: "ceil({0})",
    # Not fmin and fmax: those are calls on most targets, and here neither operand is ever NaN in a tick that is sent.
    ca.OP_FMIN: "{0} < {1} ? {0} : {1}",
    ca.OP_FMAX: "{0} > {1} ? {0} : {1}",
    ca.OP_LT: "{0} < {1} ? 1.0 : 0.0",
    ca.OP_LE: "{0} <= {1} ? 1.0 : 0.0",
    ca.OP_EQ: "{0} == {1} ? 1.0 : 0.0",
    ca.OP_NE: "{0} != {1} ? 1.0 : 0.0",
    ca.OP_NOT: "{0} == 0.0 ? 1.0 : 0.0",
    ca.OP_AND: "{0} != 0.0 && {1} != 0.0 ? 1.0 : 0.0",
    ca.OP_OR: "{0} != 0.0 || {1} != 0.0 ? 1.0 : 0.0",
    ca.OP_SIGN: "{0} > 0.0 ? 1.0 : ({0} < 0.0 ? -1.0 : 0.0)",
    ca.OP_IF_ELSE_ZERO: "{0} != 0.0 ? {1} : 0.0",
}
_NAME: Final = re.compile(r"\b[ar]\d+\b")
_COMPARISONS: Final[dict[int, str]] = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_TRIGONOMETRY: Final[dict[int, str]] = {ca.OP_SIN: "sine", ca.OP_COS: "cosine"}


def number(value: float) -> str:
    """Write a number so that C reads back the same bits."""
    text = f"{value:.17g}"
    if text in ("inf", "-inf"):
        return text.replace("inf", "INFINITY")
    return text if any(mark in text for mark in ".en") else text + ".0"


def emit(
    function: ca.Function, sources: Sequence[str], targets: Sequence[str], tabulated: Mapping[str, str] | None = None
) -> list[str]:
    """Write an SX function as C statements.

    Parameters
    ----------
    function : ca.Function
        Made of SX; all inputs and outputs dense.
    sources, targets : sequence of str
        C expressions of the arrays that its inputs are read from and its outputs written to, in its order. Matrices are
        column by column, as CasADi has them.

    tabulated : mapping of str to str, optional
        Arguments whose sine and cosine stand in the arrays `sine` and `cosine`: C expression of the argument to the
        subscript, brackets included.

    Returns
    -------
    list of str
        Statements, in order; constants go straight into the expressions that use them.

    Raises
    ------
    EmitError
        Naming an operation that has no counterpart.
    """
    tabulated = tabulated or {}
    lines: list[str] = []
    reciprocals: dict[str, str] = {}
    conditions: dict[str, str] = {}
    shared = _shared_divisors(function, sources)
    for operation, operands, result in _statements(function, sources):
        if operation == ca.OP_OUTPUT:
            which, entry = map(int, result.split())
            lines.append(f"{targets[which]}[{entry}] = {operands[0]};")
            continue
        if operation in _TRIGONOMETRY and operands[0] in tabulated:
            # Sines and cosines of the inputs are all taken at once, before this.
            lines.append(f"const double {result} = {_TRIGONOMETRY[operation]}{tabulated[operands[0]]};")
            continue
        if operation in _COMPARISONS:
            # Kept as a condition, so that a choice made by it becomes one compare and one mask.
            conditions[result] = f"{operands[0]} {_COMPARISONS[operation]} {operands[1]}"
        elif operation == ca.OP_NOT and operands[0] in conditions:
            conditions[result] = f"!({conditions[operands[0]]})"
        elif operation == ca.OP_IF_ELSE_ZERO and operands[0] in conditions:
            lines.append(f"const double {result} = {conditions[operands[0]]} ? {operands[1]} : 0.0;")
            continue
        if operation not in _OPERATIONS:
            raise EmitError(f"operation {operation} of {function.name()}: expected one with a C counterpart")
        expression = _OPERATIONS[operation].format(*operands)
        divisor = operands[-1]
        if operation in (ca.OP_DIV, ca.OP_INV) and divisor in shared:
            if divisor not in reciprocals:
                reciprocals[divisor] = f"r{len(reciprocals)}"
                lines.append(f"const double {reciprocals[divisor]} = 1.0 / {divisor};")
            expression = reciprocals[divisor]
            if operation == ca.OP_DIV:
                expression = f"{operands[0]} * {expression}"
        lines.append(f"const double {result} = {expression};")
    return _without_unused(lines)


def _without_unused(lines: list[str]) -> list[str]:
    """Drop numbers that nobody reads: conditions by which only choices were made leave them behind."""
    used: set[str] = set()
    kept: list[str] = []
    for line in reversed(lines):
        target, _, expression = line.partition(" = ")
        if not line.startswith("const double ") or target.split()[2] in used:
            used.update(_NAME.findall(expression))
            kept.append(line)
    return kept[::-1]


def _statements(function: ca.Function, sources: Sequence[str]) -> Iterator[tuple[int, list[str], str]]:
    """Instructions as (operation, operands, result), every result under a name of its own."""
    values: dict[int, str] = {}
    for index in range(function.n_instructions()):
        operation = function.instruction_id(index)
        places = function.instruction_output(index)
        if operation == ca.OP_CONST:
            constant = number(function.instruction_constant(index))
            values[places[0]] = f"({constant})" if constant.startswith("-") else constant
        elif operation == ca.OP_INPUT:
            which, entry = function.instruction_input(index)
            values[places[0]] = f"{sources[which]}[{entry}]"
        else:
            operands = [values[place] for place in function.instruction_input(index)]
            if operation == ca.OP_OUTPUT:
                yield operation, operands, f"{places[0]} {places[1]}"
            else:
                values[places[0]] = f"a{index}"
                yield operation, operands, f"a{index}"


def _shared_divisors(function: ca.Function, sources: Sequence[str]) -> set[str]:
    """Values that more than one division divides by: one division and two multiplications are cheaper than two."""
    counts = Counter(
        operands[-1] for operation, operands, _ in _statements(function, sources) if operation in (ca.OP_DIV, ca.OP_INV)
    )
    return {divisor for divisor, count in counts.items() if count > 1}
