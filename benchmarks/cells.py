"""What a sweep is made of: cells, and the blocks that they share problems in."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from ..solvers import get_solver

if TYPE_CHECKING:
    from ..solvers import Solver

#: How a solver starts: from nothing, from the last active set, from the last solution.
STARTS: Final = ("cold", "active-set", "solution")
#: Stands where a baseline's cell would have its solver and its start: a closed form has neither.
NONE: Final = "-"
# File systems allow 255 bytes; room is left for what is put behind.
_LONGEST_NAME: Final = 180


@dataclass(frozen=True, order=True)
class Block:
    """One scenario x formulation: all its cells are asked the same problems; of a baseline it is the only cell."""

    scenario: str
    formulation: str
    baseline: bool = False

    def __str__(self) -> str:
        """Write it for people."""
        return f"{self.scenario} / {self.formulation}"

    @property
    def file_stem(self) -> str:
        """Name of its files, without what is put behind."""
        return _file_stem(self.scenario, self.formulation, *([NONE] if self.baseline else []))


@dataclass(frozen=True, order=True)
class Cell:
    """One scenario x formulation x solver x start; `start` is one of `STARTS`.

    Or scenario x baseline: its name stands where a formulation's does, and solver and start are `NONE`.
    """

    scenario: str
    formulation: str
    solver: str
    start: str = "cold"

    def __str__(self) -> str:
        """Write it for people."""
        if self.is_baseline:
            return f"{self.scenario} / {self.formulation}"
        start = "" if self.start == "cold" else f" from last {self.start}"
        return f"{self.scenario} / {self.formulation} / {self.solver}{start}"

    @classmethod
    def of_baseline(cls, scenario: str, baseline: str) -> Cell:
        """Make a baseline's cell."""
        return cls(scenario, baseline, NONE, NONE)

    @property
    def is_baseline(self) -> bool:
        """Whether what is run is a baseline, without solver and start."""
        return self.solver == NONE

    @property
    def block(self) -> Block:
        """Where its problems come from."""
        return Block(self.scenario, self.formulation, self.is_baseline)

    @property
    def file_stem(self) -> str:
        """Name of its files, without what is put behind: readable, and different for different cells."""
        return _file_stem(self.scenario, self.formulation, self.solver, self.start)


def solver_of(cell: Cell) -> Solver:
    """Make a cell's solver, with the options that give it the cell's start."""
    solver = get_solver(cell.solver)
    return solver if cell.start == "cold" else get_solver(cell.solver, **solver.starts[cell.start])


def _file_stem(*parts: str) -> str:
    plain = [re.sub(r"[^\w=.,+-]", "_", part) for part in parts]
    stem = "__".join(plain)
    if tuple(plain) == parts and len(stem) <= _LONGEST_NAME:
        return stem
    # What was replaced or cut off may have been the difference.
    digest = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:8]
    return f"{stem[:_LONGEST_NAME]}-{digest}"
