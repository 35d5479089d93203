"""What is common to all modes of generated code: its structs' fields, and names."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca

from .emit import emit, number

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..formulations import Input, Mode, Tick

_LONGEST_NAME: Final = 80
# New at every tick; all other run-time inputs are parameters.
SIGNALS: Final = ("q", "v", "qd_prev", "v_fixed")
# Parameters, with a default, that are new at every tick all the same: a batch takes a row of them for each.
MEMORY: Final = ("qdd_prev",)
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
    """

    name: str
    comment: str
    size: int
    array: bool
    defaults: tuple[str, ...]


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


def identifier(text: str) -> str:
    """Turn a name into a C identifier; what is no letter or digit of ASCII becomes an underscore."""
    return re.sub(r"\W+", "_", text.replace("-", "_"), flags=re.ASCII).strip("_").lower()


def prefix_of(robot: str, formulation: str) -> str:
    """Return what the files and symbols of a formulation on a robot are called by, whatever the two are called."""
    # A file's name must leave room for what is put behind.
    return identifier(f"kinqp_{robot[:_LONGEST_NAME]}_{formulation[:_LONGEST_NAME]}")


def field_of(given: Input) -> Field:
    """Return the struct field that a run-time input is read from."""
    default = given.default if given.default is not None else [0.0] * given.size
    comment = f"{_COMMENTS.get(given.name, 'run-time parameter of the formulation')} [{given.unit}]"
    array = given.size > 1 or given.name in SIGNALS or given.name in ("task_weight", "joint_weight")
    return Field(given.name, comment, given.size, array, tuple(number(float(x)) for x in default))


def sources_of(fields: Mapping[str, Field]) -> dict[str, str]:
    """Return C expressions of the arrays that run-time inputs are read from, by name."""
    # A parameter that is a plain number is read through its address, as an array of one.
    return {
        name: f"in->{name}" if name in SIGNALS else f"p->{name}" if field.array else f"(&p->{name})"
        for name, field in fields.items()
    }


def mode_symbol(mode: Mode) -> str:
    """Return what a mode's C symbols are called by."""
    return identifier(str(mode).replace("-", "m") if "-" in mode.argument else str(mode))


def row_statements(tick: Tick) -> tuple[str, ...]:
    """Return statements that fill `rows` with the rows of the twist: J free, then J fixed, row by row."""
    rows = ca.Function("rows", [tick.q], [ca.densify(ca.vertcat(tick.J_free, tick.J_fixed).T)])
    return tuple(emit(rows, ["q"], ["rows"], {f"q[{i}]": f"[{i}]" for i in range(tick.nv)}))
