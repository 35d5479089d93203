"""Formulations of several QPs, solved one after the other: each decides only what those above it leave open."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

from .base import Formulation
from .program import DeclarationError

if TYPE_CHECKING:
    import casadi as ca

    from .program import QuadraticProgram
    from .tick import Tick

ABOVE: Final = "qd_above"


@dataclass(frozen=True)
class Hierarchy(Formulation):
    """A cascade of formulations, strictly in order.

    A level is an ordinary formulation. From the second one on it takes the command of the level above as a run-time
    input (`command_above`), and it is its own business to leave alone what that level has decided; the last level's
    command is sent. `make_step`, `compile_step` and `export_c` take the levels in order. It is not one QP and not to be
    lowered as one; each of its levels is.

    A subclass is a frozen dataclass that gives `name` and `levels`.
    """

    @property
    @abstractmethod
    def levels(self) -> tuple[Formulation, ...]:
        """The formulations to solve, the most important one first."""

    @final
    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:  # noqa: ARG002  # there is nothing to declare it in
        """Refuse: there is no one QP.

        Raises
        ------
        DeclarationError
            Always, naming the levels.
        """
        names = " > ".join(level.name for level in self.levels)
        raise DeclarationError(
            f"{self.name}: expected a formulation of one QP, got {len(self.levels)} to solve in order ({names}); "
            "make_step, compile_step and export_c do that"
        )


def levels_of(formulation: Formulation) -> tuple[Formulation, ...]:
    """Return what is solved at every tick, in order: a hierarchy's levels, or the formulation itself."""
    return formulation.levels if isinstance(formulation, Hierarchy) else (formulation,)


def command_above(tick: Tick) -> ca.SX:
    """Return the command of the level above, shape (nv, 1) [rad/s or m/s], a run-time input."""
    return tick.parameter(ABOVE, None, size=tick.nv, unit="rad/s or m/s")
