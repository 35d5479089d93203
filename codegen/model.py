"""What the templates need to know of a step: sizes, fields with their units, statements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca

from ..formulations import Hierarchy, Tick, levels_of, lower
from .cascade import cascade_code
from .definite import require_definite
from .emit import emit, needed_for
from .fields import C_NAMES, SIGNALS, ModeText, field_of, mode_symbols, row_statements, sources_of
from .kernels import KERNELS, agree, pack, padded, places, room, stage, used
from .reduction import Reduced, reduce
from .shape import Shape, identical

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..formulations import Cut, Formulation, Input, Lowered, Mode
    from ..robots import Robot
    from .fields import Field
    from .kernels import Layout

# Rows of these are padded, for loops over four columns at a time.
# What the caller has room for: guided and locked rows of the Jacobian.
_OF_CALLER: Final = (C_NAMES["J"], "locked")
_PADDED: Final = (C_NAMES["A"], *_OF_CALLER)
_PADDED_IF_DIAGONAL: Final = ("lower", "upper", "k")
# These are needed only where a row is active.
_LATE: Final = (C_NAMES["C"], "start")


@dataclass(frozen=True, kw_only=True)
class ModeCode(ModeText):
    """One motion mode of a formulation of one QP.

    `body` is what every tick computes, `late_body` what is needed only where the minimiser without rows is outside of
    some, `start_body` what is needed of that only to keep to admissible points.
    """

    n: int
    m: int
    m_eq: int
    shape: Shape
    arrays: tuple[str, ...]
    aliases: dict[str, str]
    declarations: tuple[str, ...]
    body: tuple[str, ...]
    late_body: tuple[str, ...]
    start_body: tuple[str, ...]
    kernels: tuple[str, ...]

    @property
    def size(self) -> str:
        """Variables x rows, in words."""
        return f"{self.n_null} x {self.m}"

    @property
    def starts(self) -> bool:
        """Whether a feasible point was declared."""
        return self.shape.start

    @property
    def n_null(self) -> int:
        """Variables left where the equalities have full rank, at least one: C has no arrays of size zero."""
        return max(1, self.n - self.m_eq)

    @property
    def may_be_full_rank(self) -> bool:
        """Whether the equalities can have full rank, and then leave a smaller problem: code of its own solves that."""
        return 0 < self.m_eq <= self.n and self.n_null < self.n

    @property
    def row_stride(self) -> int:
        """Number of rows, padded."""
        return padded(self.m)

    @property
    def width(self) -> int:
        """Entries from one row to the next: of the null space's basis, or of the Hessian if there are no equalities."""
        return padded(self.n_null) if self.m_eq else self.n

    @property
    def full_width(self) -> int:
        """The same where dependent equalities leave more columns."""
        return padded(self.n)


@dataclass(frozen=True)
class StepCode:
    """All that the templates are filled with.

    Attributes
    ----------
    prefix : str
        Of every symbol.
    robot, formulation : str
        For titles.
    nv : int
        Number of joints.
    m_free, m_fixed, rows, max_iterations : int
        The largest over the modes.
    parameters, inputs : tuple of Field
        Of the two structs; the largest size over the modes.
    modes : tuple of ModeText
        All `ModeCode`, or, of a hierarchy, all `CascadeCode`.
    brake_body : tuple of str
        Statements of the braking that a safe stop is where the last command is known.
    brakes : bool
        Whether a step is told the last command.
    sampled : bool
        Whether joint velocity bounds are exact in sampled time; otherwise they are those of the thesis.
    limits_acceleration : bool
        Whether the formulation promises to keep acceleration limits.
    """

    prefix: str
    robot: str
    formulation: str
    nv: int
    m_free: int
    m_fixed: int
    rows: int
    max_iterations: int
    parameters: tuple[Field, ...]
    inputs: tuple[Field, ...]
    modes: tuple[ModeText, ...]
    brake_body: tuple[str, ...]
    brakes: bool
    sampled: bool
    limits_acceleration: bool

    @property
    def single(self) -> tuple[ModeCode, ...]:
        """The modes that are one QP each: all, or none."""
        return tuple(mode for mode in self.modes if isinstance(mode, ModeCode))

    @property
    def sizes(self) -> tuple[tuple[int, int], ...]:
        """Distinct (variables, rows) of the solver, in order."""
        sizes = [(mode.n, mode.m) for mode in self.single]
        # With equalities of full rank the problem is that much smaller; without, it is padded to its full size.
        sizes += [(mode.n_null, mode.m) for mode in self.single if mode.may_be_full_rank]
        return tuple(dict.fromkeys(sizes))


def step_code(robot: Robot, formulation: Formulation, modes: Sequence[Mode], prefix: str) -> StepCode:
    """Work out the code of a formulation on a robot in one or more modes."""
    codes: tuple[ModeText, ...]
    named = tuple(zip(modes, mode_symbols(modes), strict=True))
    if isinstance(formulation, Hierarchy):
        codes = cascades = tuple(cascade_code(formulation, robot, *each) for each in named)
        max_iterations = max(code.max_iterations for code in cascades)
    else:
        codes = single = tuple(_mode_code(formulation, robot, *each) for each in named)
        max_iterations = max(10 * (code.m + code.n) + 50 for code in single)
    last = levels_of(formulation)[-1]
    largest: dict[str, Input] = {}
    for code in codes:
        # A mode without locked rows has nothing to say of their velocity, and C99 has no arrays of size zero.
        for given in filter(lambda given: given.size, code.inputs):
            if given.name not in largest or given.size > largest[given.name].size:
                largest[given.name] = given
    return StepCode(
        prefix=prefix,
        robot=robot.name,
        formulation=formulation.name,
        nv=robot.nv,
        m_free=max(code.m_free for code in codes),
        m_fixed=max(code.m_fixed for code in codes),
        rows=max(len(code.rows) for code in codes),
        max_iterations=max_iterations,
        parameters=tuple(field_of(given) for name, given in largest.items() if name not in SIGNALS),
        inputs=tuple(field_of(given) for name, given in largest.items() if name in SIGNALS),
        modes=codes,
        brake_body=_brake_body(Tick(robot, modes[0])),
        brakes="qd_prev" in largest,
        sampled=last.bounds == "viable",
        limits_acceleration=last.limits_acceleration,
    )


def _mode_code(formulation: Formulation, robot: Robot, mode: Mode, symbol: str) -> ModeCode:
    lowered, reduced = _lower_for_c(formulation, robot, mode)
    inputs, tick = lowered.inputs, lowered.tick
    fields = {given.name: field_of(given) for given in inputs}
    sources = sources_of(fields)
    shape = Shape.of(reduced)
    outputs = _outputs(lowered, reduced, shape)
    cuts = used(tick.cuts, list(outputs.values()))
    of_caller: dict[str, tuple[ca.SX, Layout]] = {n: (outputs[n], "rows") for n in _OF_CALLER if n in outputs}
    known = {given.name: (given.symbol, sources[given.name]) for given in inputs}
    staged = stage(cuts, known, len(inputs), of_caller)
    function = ca.Function(
        "data",
        [*(given.symbol for given in inputs), *(symbol for cut in cuts for symbol in cut.symbols)],
        [ca.densify(value) for value in ca.cse([ca.SX(value) for value in (*outputs.values(), *staged.outputs)])],
    )
    layouts = {name: _layout_of(name, shape) for name in outputs}
    aliases = _aliases(outputs, layouts, cuts)
    targets = [places(value.shape, layouts[name], name) for name, value in outputs.items()]
    angles = {f"in->q[{i}]": f"[{i}]" for i in range(tick.nv)}
    lines = emit(function, [*sources.values(), *staged.sources], [*targets, *staged.targets], angles, staged.calls)
    calls = (*staged.first, *staged.calls)
    late = [name for name in outputs if name in _LATE and (name != "start" or shape.diagonal)]
    early = [aliases.get(name, name) for name in outputs if name not in _LATE]
    lines = [line for line in lines if line.partition("[")[0] not in aliases]
    first, rest = needed_for([*(call.text for call in staged.first), *lines], early, calls)
    second, third = needed_for(rest, [aliases.get(name, name) for name in late], calls)
    padded_arrays = [*staged.padded, *(name for name, layout in layouts.items() if layout != "plain")]
    first, second, third = (pack(part, padded_arrays) for part in (first, second, third))
    return ModeCode(
        text=str(mode),
        symbol=symbol,
        free_names=", ".join(mode.free_names),
        n=reduced.n,
        m=reduced.m,
        m_free=mode.m_free,
        m_fixed=mode.m_fixed,
        m_eq=reduced.m_eq,
        shape=shape,
        arrays=tuple(
            f"{name}[{max(1, room(value.shape, layouts[name]))}]"
            for name, value in outputs.items()
            if name not in aliases and name not in _OF_CALLER
        ),
        aliases=aliases,
        declarations=staged.declarations,
        body=tuple(first),
        late_body=tuple(second),
        start_body=tuple(third),
        row_body=row_statements(tick),
        kernels=tuple(dict.fromkeys(cut.kernel for cut in cuts)),
        finite=tuple(field for name, field in fields.items() if name in SIGNALS and field.size),
        rows=reduced.rows,
        inputs=inputs,
    )


def _brake_body(tick: Tick) -> tuple[str, ...]:
    brake = ca.densify(tick.qd_brake)
    # Arguments of the C function: the last command by its place in it, the period by value.
    sources = {given.name: given.name for given in tick.inputs} | {"qd_prev": "last", "dt": "(&dt)"}
    function = ca.Function("brake", [given.symbol for given in tick.inputs], [brake])
    return tuple(emit(function, [sources[given.name] for given in tick.inputs], ["qd"]))


def _lower_for_c(formulation: Formulation, robot: Robot, mode: Mode) -> tuple[Lowered, Reduced]:
    """Lower with cuts, unless the declaration looks through one: a derivative doesn't see what lies behind a symbol."""
    plain, cut = lower(formulation, robot, mode), lower(formulation, robot, mode, cut=True)
    reduced = reduce(plain)
    require_definite(plain, reduced)
    return (cut, reduce(cut)) if agree(plain, cut) else (plain, reduced)


def _outputs(lowered: Lowered, reduced: Reduced, shape: Shape) -> dict[str, ca.SX]:
    """Arrays of the generated step that formulas fill in, each as C reads it: row by row."""
    outputs = {C_NAMES["H"]: ca.diag(reduced.H) if shape.diagonal else reduced.H}
    if shape.gradient:
        outputs["g"] = reduced.g
    if reduced.m_eq:
        outputs |= {C_NAMES["A"]: reduced.A, "b": reduced.b}
    # Bounds and offset as rows, where they are padded.
    outputs |= {"lower": reduced.lower.T, "upper": reduced.upper.T, C_NAMES["J"]: lowered.tick.J_free}
    if lowered.tick.m_fixed:
        outputs["locked"] = lowered.tick.J_fixed
    if not shape.direct_rows:
        outputs[C_NAMES["C"]] = reduced.C
    if not shape.direct_command:
        outputs["k"] = reduced.k.T
        if not shape.same:
            outputs[C_NAMES["K"]] = reduced.K
    if shape.start:
        outputs["start"] = reduced.start
    return outputs


def _layout_of(name: str, shape: Shape) -> Layout:
    if name in _PADDED or (shape.diagonal and name in _PADDED_IF_DIAGONAL):
        return "rows"
    return "columns" if shape.diagonal and name == C_NAMES["C"] else "plain"


def _aliases(outputs: dict[str, ca.SX], layouts: dict[str, Layout], cuts: Sequence[Cut]) -> dict[str, str]:
    """Outputs that a kernel has written already, in the same layout: name to the kernel's array."""
    found: dict[str, str] = {}
    for cut in cuts:
        for k, (symbol, layout) in enumerate(zip(cut.symbols, KERNELS[cut.kernel].results, strict=True)):
            for name, value in outputs.items():
                # A single column and a single row stand alike.
                given = value.T if value.size1() == 1 and layout == "columns" and layouts[name] == "rows" else value
                same = layouts[name] == layout or given is not value
                if same and layout != "plain" and identical(given, symbol):
                    found[name] = f"{cut.kernel}_{k}"
    return found
