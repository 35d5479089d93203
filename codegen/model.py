"""What the templates need to know of a step: sizes, fields with their units, statements."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca

from ..formulations import lower
from .emit import emit, number
from .reduction import Reduced, reduce

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..formulations import Formulation, Input, Lowered, Mode
    from ..robots import Robot

# New at every tick; all other run-time inputs are parameters.
_SIGNALS: Final = ("q", "v", "qd_prev", "v_fixed")
_COMMENTS: Final = {
    "q": "joint positions",
    "v": "velocity that the hand asks for, along the mode's axes",
    "qd_prev": "joint velocities of the tick before",
    "v_fixed": "velocity of the locked rows; zero unless drift is corrected",
    "dt": "control period",
    "q_min": "lower position limits; -INFINITY: none",
    "q_max": "upper position limits; INFINITY: none",
    "qd_max": "velocity limits",
    "qdd_max": "acceleration limits",
    "tau_max": "torque or force limits",
    "task_weight": "weights of the Cartesian error",
    "joint_weight": "weights of the joint velocities",
    "damping_threshold": "smallest singular value below which damping sets in",
    "damping_max": "damping at the singularity",
    "time_constant": "lag of the tool behind the hand; at least one period",
    "stretch_penalty": "weight of exceeding acceleration limits",
    "torque_stretch_penalty": "weight of exceeding torque limits",
    "brake_penalty": "weight of braking self-motion",
    "scale_penalty": "weight of slowing the task down",
    "acceleration_weight": "weights of the joint accelerations",
    "torque_weight": "weights of the joint torques",
    "joint_damping": "rate at which self-motion dies away",
}


@dataclass(frozen=True)
class Field:
    """A field of a C struct.

    Attributes
    ----------
    name, comment : str
        The comment ends with the unit.
    size : int
        Number of entries.
    array : bool
        Whether it is an array even with one entry.
    defaults : tuple of str
        C literals, one per entry.
    """

    name: str
    comment: str
    size: int
    array: bool
    defaults: tuple[str, ...]


@dataclass(frozen=True)
class ModeCode:
    """One motion mode of a generated library; see ``templates/step.c.j2`` for the meaning of the flags."""

    text: str
    symbol: str
    free_names: str
    n: int
    m: int
    m_free: int
    m_fixed: int
    diagonal: bool
    gradient: bool
    start: bool
    m_eq: int
    n_null: int
    h_size: int
    targets: tuple[str, ...]
    body: tuple[str, ...]
    row_body: tuple[str, ...]
    finite: tuple[Field, ...]
    rows: tuple[str, ...]
    inputs: tuple[Input, ...]


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
    modes : tuple of ModeCode
    brake_body : tuple of str
        Statements of the safe stop by braking; empty where the safe stop is zero velocity.
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
    modes: tuple[ModeCode, ...]
    brake_body: tuple[str, ...]

    @property
    def sizes(self) -> tuple[tuple[int, int], ...]:
        """Distinct (variables, rows) of the solver, in order."""
        sizes = [(mode.n, mode.m) for mode in self.modes]
        # With equalities of full rank the problem is that much smaller; without, it is padded to its full size.
        sizes += [(mode.n_null, mode.m) for mode in self.modes if mode.m_eq]
        return tuple(dict.fromkeys(sizes))


def step_code(robot: Robot, formulation: Formulation, modes: Sequence[Mode], prefix: str) -> StepCode:
    """Work out the code of a formulation on a robot in one or more modes."""
    lowered = tuple(lower(formulation, robot, mode) for mode in modes)
    codes = tuple(_mode_code(each) for each in lowered)
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
        rows=max(code.m for code in codes),
        max_iterations=max(10 * (code.m + code.n) + 50 for code in codes),
        parameters=tuple(_field(given) for name, given in largest.items() if name not in _SIGNALS),
        inputs=tuple(_field(given) for name, given in largest.items() if name in _SIGNALS),
        modes=codes,
        brake_body=_brake_body(lowered[0]) if formulation.safe_stop == "braking" else (),
    )


def identifier(text: str) -> str:
    """Turn a name into a C identifier."""
    return re.sub(r"\W+", "_", text.replace("-", "_")).strip("_").lower()


def _field(given: Input) -> Field:
    default = given.default if given.default is not None else [0.0] * given.size
    comment = f"{_COMMENTS.get(given.name, 'run-time parameter of the formulation')} [{given.unit}]"
    array = given.size > 1 or given.name in _SIGNALS or given.name in ("task_weight", "joint_weight")
    return Field(given.name, comment, given.size, array, tuple(number(float(x)) for x in default))


def _mode_code(lowered: Lowered) -> ModeCode:
    reduced = reduce(lowered)
    gradient = not reduced.g.is_zero()
    diagonal = reduced.diagonal and not gradient and not reduced.m_eq
    outputs = _outputs(lowered, reduced, gradient=gradient, diagonal=diagonal)
    inputs = lowered.inputs
    function = ca.Function(
        "data",
        [given.symbol for given in inputs],
        [ca.densify(value) for value in ca.cse([ca.SX(value) for value in outputs.values()])],
    )
    fields = {given.name: _field(given) for given in inputs}
    sources = _sources(fields)
    mode = lowered.mode
    tick = lowered.tick
    angles = {f"in->q[{i}]": f"[{i}]" for i in range(tick.nv)}
    rows = ca.Function("rows", [tick.q], [ca.densify(ca.vertcat(tick.J_free, tick.J_fixed).T)])
    return ModeCode(
        text=str(mode),
        symbol=identifier(str(mode).replace("-", "m") if "-" in mode.argument else str(mode)),
        free_names=", ".join(mode.free_names),
        n=reduced.n,
        m=reduced.m,
        m_free=mode.m_free,
        m_fixed=mode.m_fixed,
        diagonal=diagonal,
        gradient=gradient,
        start=bool(reduced.start.size1()),
        m_eq=reduced.m_eq,
        n_null=reduced.n - reduced.m_eq,
        h_size=reduced.n if diagonal else reduced.n**2,
        targets=tuple(outputs),
        body=tuple(emit(function, sources, list(outputs), angles)),
        row_body=tuple(emit(rows, ["q"], ["rows"], {f"q[{i}]": f"[{i}]" for i in range(tick.nv)})),
        finite=tuple(field for name, field in fields.items() if name in _SIGNALS and field.size),
        rows=reduced.rows,
        inputs=inputs,
    )


def _sources(fields: Mapping[str, Field]) -> list[str]:
    # A parameter that is a plain number is read through its address, as an array of one.
    return [
        f"in->{name}" if name in _SIGNALS else f"p->{name}" if field.array else f"(&p->{name})"
        for name, field in fields.items()
    ]


def _brake_body(lowered: Lowered) -> tuple[str, ...]:
    brake = ca.densify(lowered.tick.qd_brake)
    function = ca.Function("brake", [given.symbol for given in lowered.inputs], [brake])
    return tuple(emit(function, _sources({given.name: _field(given) for given in lowered.inputs}), ["qd"]))


def _outputs(lowered: Lowered, reduced: Reduced, *, gradient: bool, diagonal: bool) -> dict[str, ca.SX]:
    # CasADi writes column by column, the C code reads row by row: hence the transposes.
    outputs = {"H": ca.diag(reduced.H) if diagonal else reduced.H}
    if gradient:
        outputs["g"] = reduced.g
    if reduced.m_eq:
        outputs |= {"A": reduced.A.T, "b": reduced.b}
    outputs |= {"C": reduced.C.T, "lower": reduced.lower, "upper": reduced.upper, "K": reduced.K.T, "k": reduced.k}
    outputs["J"] = lowered.tick.J_free.T
    if reduced.start.size1():
        outputs["start"] = reduced.start
    return outputs
