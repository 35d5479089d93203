"""A hierarchy in one mode as C: its levels' QPs, each solved by the general solver that the interpreted step uses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca

from ..formulations import ABOVE, DATA, DeclarationError, lower
from ..solvers.active_set import library
from .emit import emit
from .fields import SIGNALS, ModeText, c_name, field_of, row_statements, sources_of

if TYPE_CHECKING:
    from ..formulations import Hierarchy, Input, Lowered, Mode
    from ..robots import Robot


@dataclass(frozen=True)
class LevelCode:
    """One level of a hierarchy in one mode.

    Attributes
    ----------
    name : str
        Of the level's formulation.
    n, p, m : int
        Variables, rows of A and rows of C.
    starts : bool
        Whether a feasible point was declared.
    sizes : dict of str to int
        Array that `body` fills in to its number of entries; there are none without entries.
    body : tuple of str
        Statements that compute the QP and what its answer is judged by, matrices row by row.
    named : tuple of int
        Which of C's rows, then of the box, can hold the command back.
    workspace : int
        Doubles that the solver works in.
    """

    name: str
    n: int
    p: int
    m: int
    starts: bool
    sizes: dict[str, int]
    body: tuple[str, ...]
    named: tuple[int, ...]
    workspace: int

    @property
    def max_iterations(self) -> int:
        """The general solver's own cap."""
        return 50 * (self.m + self.n) + 200


@dataclass(frozen=True, kw_only=True)
class CascadeCode(ModeText):
    """One motion mode of a hierarchy: levels in order, rows of all of them one after the other."""

    levels: tuple[LevelCode, ...]

    @property
    def size(self) -> str:
        """Variables x rows of each level, in words; rows without equalities."""
        return ", then ".join(f"{level.n} x {len(level.named)}" for level in self.levels)

    @property
    def starts(self) -> bool:
        """Whether every level has an admissible point to fall back on."""
        return all(level.starts for level in self.levels)

    @property
    def max_iterations(self) -> int:
        """Steps that a tick may take over all levels."""
        return sum(level.max_iterations for level in self.levels)


def cascade_code(formulation: Hierarchy, robot: Robot, mode: Mode, symbol: str) -> CascadeCode:
    """Work out the code of a hierarchy in one mode, whose C symbols are called by `symbol`.

    Raises
    ------
    DeclarationError
        When its levels don't agree on what the safe stop is.
    """
    if len({level.safe_stop for level in formulation.levels}) != 1:
        stops = ", ".join(f"{level.name}: {level.safe_stop}" for level in formulation.levels)
        raise DeclarationError(f"{formulation.name}: expected one safe stop of all levels, got {stops}")
    lowered = [lower(level, robot, mode) for level in formulation.levels]
    inputs: dict[str, Input] = {}
    for level in lowered:
        inputs |= {given.name: given for given in level.inputs if given.name not in inputs and given.name != ABOVE}
    tick = lowered[0].tick
    return CascadeCode(
        text=str(mode),
        symbol=symbol,
        free_names=", ".join(mode.free_names),
        m_free=mode.m_free,
        m_fixed=mode.m_fixed,
        row_body=row_statements(tick),
        finite=tuple(field_of(given) for name, given in inputs.items() if name in SIGNALS and given.size),
        rows=tuple(name for level in lowered for name in _labels(level) if name),
        inputs=tuple(inputs.values()),
        levels=tuple(_level_code(level) for level in lowered),
    )


def _labels(lowered: Lowered) -> tuple[str, ...]:
    return *lowered.rows.inequalities, *lowered.rows.box


def _level_code(lowered: Lowered) -> LevelCode:
    tick = lowered.tick
    data = dict(zip(DATA, lowered.function(*(given.symbol for given in lowered.inputs)), strict=True))
    outputs = {c_name(name): ca.SX(value).T for name, value in data.items() if value.numel()}
    values = ca.cse([ca.densify(value) for value in outputs.values()])
    function = ca.Function("level", [given.symbol for given in tick.inputs], values)
    sources = sources_of({given.name: field_of(given) for given in tick.inputs}) | {ABOVE: "above"}
    angles = {f"in->q[{i}]": f"[{i}]" for i in range(tick.nv)}
    p, m = data["A"].shape[0], data["C"].shape[0]
    return LevelCode(
        name=lowered.formulation.name,
        n=lowered.n,
        p=p,
        m=m,
        starts=bool(data["x_feasible"].numel()),
        sizes={name: value.numel() for name, value in outputs.items()},
        body=tuple(emit(function, [sources[given.name] for given in tick.inputs], list(outputs), angles)),
        named=tuple(i for i, label in enumerate(_labels(lowered)) if label),
        workspace=library.workspace_doubles(lowered.n, p, m),
    )
