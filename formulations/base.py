"""What a formulation is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from .bounds import BOUNDS

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

SafeStop = Literal["zero", "braking"]


@dataclass(frozen=True)
class Formulation(ABC):
    """A way to turn the hand's velocity into joint velocities, declared once as a QP.

    A subclass is a frozen dataclass: it gives `name` and `declare`, and its fields are its options. Numbers that a
    controller may want to change while it runs are not options but ``tick.parameter``.

    Parameters
    ----------
    bounds : {"viable", "thesis"}
        How joint velocity bounds follow from the limits; see `kinqp.formulations.velocity_bounds`.

    Notes
    -----
    `safe_stop` says what is sent where a tick is not solved: zero velocity at once, or, for a formulation that keeps to
    acceleration limits, the fastest admissible braking from the last command (`kinqp.formulations.braking`). The
    latter makes `qd_prev` an input of every step.
    """

    bounds: str = "viable"

    name: ClassVar[str]
    safe_stop: ClassVar[SafeStop] = "zero"

    def __post_init__(self) -> None:
        if self.bounds not in BOUNDS:
            raise ValueError(f"bounds: expected one of {', '.join(BOUNDS)}, got {self.bounds!r}")

    @abstractmethod
    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle.

        Parameters
        ----------
        qp : QuadraticProgram
            Takes variables, weighted residuals, rows and the command.
        tick : Tick
            Gives the symbols of the control cycle.
        """
