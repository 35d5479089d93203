"""Straight-line C from a CasADi SX function, one statement per instruction, no memory but its arguments."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import casadi as ca

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence


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
_NAME: Final = re.compile(r"\b[A-Za-z_]\w*")
_COMPARISONS: Final[dict[int, str]] = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_TRIGONOMETRY: Final[dict[int, str]] = {ca.OP_SIN: "sine", ca.OP_COS: "cosine"}


def number(value: float) -> str:
    """Write a number so that C reads back the same bits."""
    text = f"{value:.17g}"
    if text in ("inf", "-inf"):
        return text.replace("inf", "INFINITY")
    if text == "nan":
        return "NAN"
    return text if any(mark in text for mark in ".en") else text + ".0"


@dataclass(frozen=True)
class Call:
    """A statement among the others that reads and writes arrays, such as the call of a kernel.

    Attributes
    ----------
    text : str
        The C statement.
    fills : tuple of int
        Which of the function's inputs it writes: what depends on them comes behind it.
    writes : tuple of str
        Names of the arrays that it writes.
    """

    text: str
    fills: tuple[int, ...]
    writes: tuple[str, ...]


def emit(
    function: ca.Function,
    sources: Sequence[str | Sequence[str]],
    targets: Sequence[str | Sequence[str]],
    tabulated: Mapping[str, str] | None = None,
    calls: Sequence[Call] = (),
) -> list[str]:
    """Write an SX function as C statements.

    Parameters
    ----------
    function : ca.Function
        Made of SX; all inputs and outputs dense.
    sources, targets : sequence of str or of sequences of str
        C expressions of the arrays that its inputs are read from and its outputs written to, in its order, or of all
        their entries. Matrices are column by column, as CasADi has them.
    tabulated : mapping of str to str, optional
        Arguments whose sine and cosine stand in the arrays `sine` and `cosine`: C expression of the argument to the
        subscript, brackets included.
    calls : sequence of Call
        Statements to be put in, in this order; each may read outputs that depend on what earlier ones fill in.

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
    statements = list(_statements(function, sources, calls))
    shared = _shared_divisors(statements)
    # What depends on no call comes first, then each call and what depends on it; otherwise the order is CasADi's.
    statements.sort(key=lambda statement: statement.stage)
    stage = 0
    for operation, operands, result, needed in statements:
        while stage < needed:
            lines.append(calls[stage].text)
            stage += 1
        if operation == ca.OP_OUTPUT:
            which, entry = map(int, result.split())
            lines.append(f"{_entry(targets[which], entry)} = {operands[0]};")
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
    # Conditions by which only choices were made leave numbers behind that nobody reads.
    arrays = [_NAME.findall(_entry(target, 0))[0] for target in targets if target]
    return needed_for(lines, arrays, calls)[0]


def needed_for(lines: Sequence[str], arrays: Iterable[str], calls: Sequence[Call] = ()) -> tuple[list[str], list[str]]:
    """Split statements into those that some arrays need, and the others, both in their order."""
    writes = {call.text: call.writes for call in calls}
    wanted = set(arrays)
    needed: list[str] = []
    others: list[str] = []
    for line in reversed(lines):
        target, _, expression = line.partition(" = ")
        written = writes.get(line) or (target.removeprefix("const double ").partition("[")[0],)
        if wanted.isdisjoint(written):
            others.append(line)
        else:
            needed.append(line)
            wanted.update(_NAME.findall(line if line in writes else expression))
    return needed[::-1], others[::-1]


class _Statement(NamedTuple):
    operation: int
    operands: list[str]
    result: str
    stage: int  # calls that have to come before


def _entry(array: str | Sequence[str], entry: int) -> str:
    return f"{array}[{entry}]" if isinstance(array, str) else array[entry]


def _statements(
    function: ca.Function, sources: Sequence[str | Sequence[str]], calls: Sequence[Call]
) -> Iterator[_Statement]:
    """Instructions, every result under a name of its own."""
    filled = {which: stage for stage, call in enumerate(calls, start=1) for which in call.fills}
    values: dict[int, tuple[str, int]] = {}
    for index in range(function.n_instructions()):
        operation = function.instruction_id(index)
        places = function.instruction_output(index)
        if operation == ca.OP_CONST:
            constant = number(function.instruction_constant(index))
            values[places[0]] = f"({constant})" if constant.startswith("-") else constant, 0
        elif operation == ca.OP_INPUT:
            which, entry = function.instruction_input(index)
            values[places[0]] = _entry(sources[which], entry), filled.get(which, 0)
        else:
            given = [values[place] for place in function.instruction_input(index)]
            operands, stage = [name for name, _ in given], max((stage for _, stage in given), default=0)
            if operation == ca.OP_OUTPUT:
                yield _Statement(operation, operands, f"{places[0]} {places[1]}", stage)
            else:
                values[places[0]] = f"a{index}", stage
                yield _Statement(operation, operands, f"a{index}", stage)


def _shared_divisors(statements: Sequence[_Statement]) -> set[str]:
    """Values that more than one division divides by: one division and two multiplications are cheaper than two."""
    counts = Counter(
        statement.operands[-1] for statement in statements if statement.operation in (ca.OP_DIV, ca.OP_INV)
    )
    return {divisor for divisor, count in counts.items() if count > 1}
