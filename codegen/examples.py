"""Values for parameters without a default, so that ticks can be recorded with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from .emit import number
from .fields import is_required

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from ..formulations import Input

    Array = NDArray[np.float64]


class ExportError(ValueError):
    """A step can't be exported as asked; the message names what and why."""


def example_inputs(inputs: Iterable[Input], q: Array) -> dict[str, Array]:
    """Give a value to each run-time parameter without a default, such as would make sense at a state.

    Parameters
    ----------
    inputs : iterable of Input
        Of a lowered formulation, or of all levels of a hierarchy.
    q : ndarray, shape (nv,)
        The state [rad or m].

    Returns
    -------
    dict of str to ndarray
        By name, each of shape (size,).

    Raises
    ------
    ExportError
        Naming a parameter that has no example either, or an example that its own range excludes.
    """
    given = list(inputs)
    named = ((each.symbol, q if each.name == "q" else each.default) for each in given)
    known = [(symbol, value) for symbol, value in named if value is not None]
    found: dict[str, Array] = {}
    for each in filter(is_required, given):
        if each.example is None:
            raise ExportError(
                f"{each.name}: expected a default, or an example to record ticks with, got neither; give one where it "
                f"is declared, parameter({each.name!r}, ..., example=...), or as an option if there is one"
            )
        function = ca.Function("example", [symbol for symbol, _ in known], [each.example])
        value = np.asarray(function.call([ca.DM(value) for _, value in known])[0], dtype=np.float64).ravel()
        if value.shape != (each.size,) or not each.admits(value):
            raise ExportError(f"{each.name}: expected as example {each.size} {each.describe_range()}, got {value}")
        found[each.name] = value
    return found


def stack_examples(per_mode: Sequence[dict[str, Array]]) -> dict[str, Array]:
    """Make a table of each parameter, one row for each mode, as wide as the widest of them.

    A mode without the parameter has the values of another one, which nothing in it depends on; room that a mode has no
    use for is filled with its last value, since what is in there must be within the parameter's range.
    """
    tables: dict[str, Array] = {}
    for name in dict.fromkeys(name for examples in per_mode for name in examples):
        width = max(len(examples[name]) for examples in per_mode if name in examples)
        stand_in = next(examples[name] for examples in per_mode if name in examples)
        rows = [examples.get(name, stand_in) for examples in per_mode]
        tables[name] = np.array([np.pad(row, (0, width - len(row)), mode="edge") for row in rows])
    return tables


def example_lines(tables: dict[str, Array]) -> list[str]:
    """Write the tables of `stack_examples` in C."""
    lines: list[str] = []
    for name, table in tables.items():
        rows, width = table.shape
        lines += ["", f"/* {name}, which has no default, in each mode */"]
        lines += [f"static const double recorded_parameter_{name}[{rows}][{width}] = {{"]
        lines += [f"    {{{', '.join(number(float(x)) for x in row)}}}," for row in table]
        lines.append("};")
    return lines
