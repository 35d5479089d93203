"""A formulation that declares whatever a test wants, and how it is lowered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from kinqp.formulations import Formulation, Lowered, Mode, QuadraticProgram, Tick, lower
from tests.robots.arms import arm

if TYPE_CHECKING:
    from collections.abc import Callable

    import casadi as ca

    Declare = Callable[[QuadraticProgram, Tick], object]

ROBOT = arm("ur5e")


@dataclass(frozen=True)
class Declared(Formulation):
    """Declares whatever it is given."""

    declaration: Declare | None = None

    name: ClassVar[str] = "declared"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        assert self.declaration is not None
        self.declaration(qp, tick)


def lowered(declaration: Declare, mode: str = "position") -> Lowered:
    return lower(Declared(declaration=declaration), ROBOT, Mode.parse(mode))


def with_qd(more: Callable[[QuadraticProgram, Tick, ca.SX], object]) -> Declare:
    """Start from six joint velocities that are the command."""

    def declaration(qp: QuadraticProgram, tick: Tick) -> None:
        qd = qp.variable("qd", 6)
        qp.command(qd)
        more(qp, tick, qd)

    return declaration
