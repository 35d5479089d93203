"""What is common to all modes of generated code: its structs' fields, and names."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from ..formulations import ABOVE
from .emit import emit, number
from .kernels import pack, places

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..formulations import Input, Mode, Tick

# Arrays of generated code by the letter that formulas give them. Every name that generated code defines is in lower
# case, or begins with KINQP_ or with the export's own prefix: a user's macro, such as -DN=3, never replaces one.
C_NAMES: Final = {"H": "hessian", "A": "equalities", "C": "constraints", "J": "jacobian", "K": "command"}
_LONGEST_NAME: Final = 80
# New at every tick; all other run-time inputs are parameters.
SIGNALS: Final = ("q", "v", "qd_prev", "v_fixed")
# Parameters, with a default, that are new at every tick all the same: a batch takes a row of them for each.
MEMORY: Final = ("qdd_prev",)
# One for each joint, or for each of several things: arrays even where there is one, since code runs over them.
_ARRAYS: Final = (*SIGNALS, "qdd_prev", "q_min", "q_max", "qd_max", "qdd_max", "tau_max", "task_weight", "joint_weight")
_COMMENTS: Final = {
    "q": "joint positions",
    "v": "velocity that the hand asks for, along the mode's axes",
    "qd_prev": "joint velocities of the tick before",
    "v_fixed": "velocity of the locked rows; zero unless drift is corrected",
    "qdd_prev": "joint accelerations of the tick before, new at every tick; INFINITY: unknown, jerk is not limited",
    "jerk_time": "time that accelerations take from nothing to their limit",
    "limit_time": "least time constant with which limits are approached",
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
    least, most : str
        C literals of the range that is accepted.
    range : str
        The same in words.
    """

    name: str
    comment: str
    size: int
    array: bool
    defaults: tuple[str, ...]
    least: str
    most: str
    range: str


@dataclass(frozen=True, kw_only=True)
class ModeText(ABC):
    """What the header and the parts that modes share need to know of one motion mode.

    Attributes
    ----------
    text, symbol : str
        The mode, and what its C symbols are called by.
    free_names : str
        The guided axes.
    m_free, m_fixed : int
        Guided and locked rows.
    row_body : tuple of str
        Statements that compute the rows of the twist.
    finite : tuple of Field
        Inputs that are refused where they are not finite.
    rows : tuple of str
        Names of what may hold the command back.
    inputs : tuple of Input
        Run-time inputs.
    """

    text: str
    symbol: str
    free_names: str
    m_free: int
    m_fixed: int
    row_body: tuple[str, ...]
    finite: tuple[Field, ...]
    rows: tuple[str, ...]
    inputs: tuple[Input, ...]

    @property
    @abstractmethod
    def size(self) -> str:
        """Variables x rows, in words."""

    @property
    @abstractmethod
    def starts(self) -> bool:
        """Whether a capped tick has an admissible point to fall back on."""


def c_name(name: str) -> str:
    """Name of an array in generated code: see `C_NAMES`."""
    return C_NAMES.get(name, name)


def identifier(text: str) -> str:
    """Turn a name into a C identifier: letters, digits and underscores of ASCII, in lower case."""
    return re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_").lower()


def prefix_of(robot: str, formulation: str) -> str:
    """Return what the files and symbols of a formulation on a robot are called by, whatever the two are called."""
    # A file's name must leave room for what is put behind.
    return identifier(f"kinqp_{robot[:_LONGEST_NAME]}_{formulation[:_LONGEST_NAME]}")


def is_required(given: Input) -> bool:
    """Whether a run-time input is a parameter that the caller must set, because it has no default."""
    return given.default is None and given.name not in (*SIGNALS, ABOVE)


def field_of(given: Input) -> Field:
    """Return the struct field that a run-time input is read from."""
    # NaN is refused, so that a parameter that was forgotten is no zero that means something.
    default = given.default if given.default is not None else [np.nan] * given.size
    must = ", no default: must be set" if is_required(given) else ""
    comment = f"{_COMMENTS.get(given.name, 'run-time parameter of the formulation')}{must} [{given.unit}]"
    array = given.size > 1 or given.name in _ARRAYS
    least, most = map(number, given.range)
    defaults = tuple(number(float(x)) for x in default)
    return Field(given.name, comment, given.size, array, defaults, least, most, given.describe_range())


def sources_of(fields: Mapping[str, Field]) -> dict[str, str]:
    """Return C expressions of the arrays that run-time inputs are read from, by name."""
    # A parameter that is a plain number is read through its address, as an array of one.
    return {
        name: f"in->{name}" if name in SIGNALS else f"p->{name}" if field.array else f"(&p->{name})"
        for name, field in fields.items()
    }


def mode_symbols(modes: Sequence[Mode]) -> tuple[str, ...]:
    """Return what the C symbols of each mode of a library are called by, each another name.

    Where plain names are the same, as those of `plane:0.1,0,5` and `plane:0,1,0.5` are, these modes write their decimal
    points as "p": `plane_0p1_0_5`, `plane_0_1_0p5`. The names do not depend on the order of the modes.
    """
    symbols = [identifier(str(mode).replace("-", "m") if "-" in mode.argument else str(mode)) for mode in modes]
    for spelling in (_spelled, _numbered):
        taken = Counter(symbols)
        symbols = [
            symbol if taken[symbol] == 1 and symbol else spelling(mode)
            for mode, symbol in zip(modes, symbols, strict=True)
        ]
    return tuple(symbols)


def _spelled(mode: Mode) -> str:
    """Write a mode so that any other one that `Mode.parse` reads is written in another way."""
    argument = mode.argument.replace(".", "p").replace("-", "m").replace("+", "")
    return identifier(str(mode).replace(f":{mode.argument}", f":{argument}"))


def _numbered(mode: Mode) -> str:
    """Write a mode of one's own, whose name need not have a letter that C knows, by the bytes of its name."""
    return f"mode_{str(mode).encode().hex()}"


def row_statements(tick: Tick) -> tuple[str, ...]:
    """Return statements that fill `rows` with the rows of the twist, padded: J free, then J fixed."""
    value = ca.densify(ca.vertcat(tick.J_free, tick.J_fixed))
    rows = ca.Function("rows", [tick.q], [value])
    angles = {f"q[{i}]": f"[{i}]" for i in range(tick.nv)}
    return tuple(pack(emit(rows, ["q"], [places(value.shape, "rows", "rows")], angles), ["rows"]))
