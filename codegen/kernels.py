"""The kernels of generated code: how each lays out its arrays, and the calls that a tick's cuts turn into.

A kernel is a file of C in ``templates/kernels/``. Rows that run over joints are padded with zeros to a multiple of
`LANES` entries, so that loops over joints have no remainder.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import casadi as ca
import numpy as np

from .emit import Call
from .shape import identical

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ..formulations import Cut, Input, Lowered
    from ..robots import Robot

LANES: Final = 4
# Row by row, padded; column by column, padded; row by row as they are; one number by value.
Layout = Literal["rows", "columns", "plain", "number"]


# States at which `agree` compares, and how closely, relative to 1 and the value.
_STATES: Final = 3
_AGREE: Final = 1e-9


@dataclass(frozen=True)
class Kernel:
    """How a kernel takes its arguments, behind its sizes: inputs, then results."""

    inputs: tuple[Layout, ...]
    results: tuple[Layout, ...]


KERNELS: Final = {
    "locked_rows": Kernel(("rows", "rows", "plain", "plain"), ("rows", "columns", "plain")),
    "robust_inverse": Kernel(("rows", "number", "number", "plain", "columns"), ("columns", "columns")),
    "viable_bounds": Kernel(("plain", "plain", "plain", "plain", "plain", "number"), ("plain", "plain")),
    "thesis_bounds": Kernel(("plain", "plain", "plain", "plain", "plain", "number"), ("plain", "plain")),
}


@dataclass(frozen=True)
class Staged:
    """Cuts as C.

    Attributes
    ----------
    declarations : tuple of str
        Of the arrays between formulas and kernels.
    sources : tuple of tuple of str
        Where the symbols of the cuts are read, entry by entry, column by column.
    outputs : tuple of ca.SX
        What formulas have to compute for the kernels.
    targets : tuple of tuple of str
        Where to.
    padded : tuple of str
        Which of the arrays that formulas fill in have padded rows.
    first : tuple of Call
        Those that need no formula, only run-time inputs; they come before everything else.
    calls : tuple of Call
        The others, in order.
    """

    declarations: tuple[str, ...]
    sources: tuple[tuple[str, ...], ...]
    outputs: tuple[ca.SX, ...]
    targets: tuple[tuple[str, ...], ...]
    padded: tuple[str, ...]
    first: tuple[Call, ...]
    calls: tuple[Call, ...]


def stage(
    cuts: Sequence[Cut],
    given: Mapping[str, tuple[ca.SX, str]],
    first: int,
    written: Mapping[str, tuple[ca.SX, Layout]],
) -> Staged:
    """Lay out the arrays of cuts and write their calls.

    Parameters
    ----------
    cuts : sequence of Cut
        In the order of their calls.
    given : mapping of str to (ca.SX, str)
        Run-time inputs by name: symbol, and C expression of its array. A kernel reads them where they are.
    first : int
        Position of the first cut's first symbol among the arguments of the function that is emitted.
    written : mapping of str to (ca.SX, Layout)
        Outputs that no cut takes part in, by the name of their array: a kernel reads them there, too.
    """
    places: dict[str, tuple[str, Layout]] = {}  # a symbol's or input's array and its layout, by the name of its entries
    for symbol, expression in given.values():
        places[_label(symbol)] = expression, "plain"
    inputs = set(places)
    declarations: list[str] = []
    by_four: list[str] = []
    sources: list[tuple[str, ...]] = []
    outputs: list[ca.SX] = []
    targets: list[tuple[str, ...]] = []
    at_once: list[Call] = []
    calls: list[Call] = []
    position = first
    for index, cut in enumerate(cuts):
        kernel = KERNELS[cut.kernel]
        arguments = [str(size) for size in cut.sizes]
        before = len(outputs)
        for k, (value, layout) in enumerate(zip(cut.inputs, kernel.inputs, strict=True)):
            label = _label(value)
            known = places.get(label) if label else None
            if known is not None and layout in (known[1], "number"):
                arguments.append(f"{known[0]}[0]" if layout == "number" else known[0])
                continue
            same = next((n for n, (w, way) in written.items() if way == layout and identical(w, value)), None)
            if same is not None:
                arguments.append(same)
                continue
            name = f"k{index}_{k}"
            shape, entries = _layout(value.shape, "plain" if layout == "number" else layout, name)
            declarations.append(f"double {name}[{shape}];")
            if layout in ("rows", "columns"):
                by_four.append(name)
            outputs.append(ca.densify(value))
            targets.append(entries)
            arguments.append(f"{name}[0]" if layout == "number" else name)
        for k, (symbol, layout) in enumerate(zip(cut.symbols, kernel.results, strict=True)):
            name = f"{cut.kernel}_{k}"
            shape, entries = _layout(symbol.shape, layout, name)
            declarations.append(f"double {name}[{shape}];")
            sources.append(entries)
            places[_label(symbol)] = name, layout
            arguments.append(name)
        fills = tuple(range(position, position + len(cut.symbols)))
        position += len(cut.symbols)
        results = tuple(arguments[-len(cut.symbols) :])
        only_inputs = len(outputs) == before and all(_label(value) in inputs for value in cut.inputs)
        made = Call(f"kinqp_{cut.kernel}({', '.join(arguments)});", () if only_inputs else fills, results)
        (at_once if only_inputs else calls).append(made)
    return Staged(
        tuple(declarations),
        tuple(sources),
        tuple(outputs),
        tuple(targets),
        tuple(by_four),
        tuple(at_once),
        tuple(calls),
    )


def used(cuts: Sequence[Cut], values: Sequence[ca.SX]) -> list[Cut]:
    """Leave out the cuts that no value depends on."""
    needed = list(values)
    kept: list[Cut] = []
    for cut in reversed(cuts):
        symbols = ca.vertcat(*(ca.vec(symbol) for symbol in cut.symbols))
        if any(ca.depends_on(ca.SX(value), symbols) for value in needed):
            kept.append(cut)
            needed += cut.inputs
    return kept[::-1]


def agree(plain: Lowered, cut: Lowered) -> bool:
    """Whether a declaration gives the same QP with its cuts filled in by their formulas, at a few random states."""
    rng = np.random.default_rng(0)
    names = [given.name for given in cut.inputs]
    if names != [given.name for given in plain.inputs]:
        return False
    symbols = [given.symbol for given in cut.inputs]
    # Each cut's formulas may use the symbols of those before.
    filled: list[ca.SX] = []
    for made in cut.tick.cuts:
        earlier = [symbol for other in cut.tick.cuts[: cut.tick.cuts.index(made)] for symbol in other.symbols]
        formulas = [ca.densify(formula) for formula in made.formulas]
        filled += ca.Function("cut", [*symbols, *earlier], formulas).call([*symbols, *filled])
    whole = ca.Function("filled", symbols, cut.function.call([*symbols, *filled]))
    for _ in range(_STATES):
        values = [_random_value(given, plain.robot, rng) for given in cut.inputs]
        for one, other in zip(plain.function.call(values), whole.call(values), strict=True):
            a, b = np.asarray(one), np.asarray(other)
            if not np.allclose(a, b, rtol=_AGREE, atol=_AGREE):
                return False
    return True


def _random_value(given: Input, robot: Robot, rng: np.random.Generator) -> NDArray[np.float64]:
    if given.name == "q":
        low, high = np.maximum(robot.q_min, -np.pi), np.minimum(robot.q_max, np.pi)
        return np.asarray(low + (high - low) * rng.random(robot.nv))
    if given.default is None:
        return rng.normal(size=given.size)
    # Parameters move a little too: a derivative by one of them would not be seen otherwise.
    return np.asarray(given.default * rng.uniform(0.8, 1.0, given.size))


def pack(lines: Sequence[str], arrays: Sequence[str]) -> list[str]:
    """Write padded arrays four entries at a time.

    Four single numbers just written can't be read as one vector before all of them have reached the cache.

    Parameters
    ----------
    lines : sequence of str
        Statements; among them every entry of `arrays` once, padding aside.
    arrays : sequence of str
        Names.
    """
    entry = re.compile(rf"({'|'.join(map(re.escape, arrays))})\[(\d+)\] = ([^;]+);") if arrays else None
    found = [entry.fullmatch(line) if entry else None for line in lines]
    groups: dict[tuple[str, int], dict[int, str]] = {}
    last: dict[tuple[str, int], int] = {}
    for number, match in enumerate(found):
        if match:
            group = match[1], int(match[2]) // LANES
            groups.setdefault(group, {})[int(match[2]) % LANES] = match[3]
            last[group] = number
    ends = {number: group for group, number in last.items()}
    packed: list[str] = []
    for number, line in enumerate(lines):
        if number in ends:
            name, place = ends[number]
            values = groups[name, place]
            four = ", ".join(values.get(lane, "0.0") for lane in range(LANES))
            packed.append(f"kinqp_put({name} + {place * LANES}, {four});")
        elif not found[number]:
            packed.append(line)
    return packed


def padded(size: int) -> int:
    """Round a size up to a multiple of `LANES`."""
    return -(-size // LANES) * LANES


def places(shape: tuple[int, int], layout: Layout, name: str) -> tuple[str, ...]:
    """C expressions of a matrix's entries, column by column, in an array of this layout."""
    return _layout(shape, layout, name)[1]


def room(shape: tuple[int, int], layout: Layout) -> int:
    """Entries of that array, padding included."""
    return _layout(shape, layout, "")[0]


def _label(value: ca.SX) -> str:
    """Name that tells whether an expression is nothing but the symbols of one array; empty if it is more."""
    entries = ca.vertsplit(ca.vec(value))
    return " ".join(str(entry.element_hash()) for entry in entries) if all(e.is_symbolic() for e in entries) else ""


def _layout(shape: tuple[int, int], layout: Layout, name: str) -> tuple[int, tuple[str, ...]]:
    """Size of an array, and its entries column by column."""
    rows, columns = shape
    if layout == "columns":
        stride = padded(rows)
        return columns * stride, tuple(f"{name}[{j * stride + i}]" for j in range(columns) for i in range(rows))
    stride = padded(columns) if layout == "rows" else columns
    return rows * stride, tuple(f"{name}[{i * stride + j}]" for j in range(columns) for i in range(rows))
