"""What a baseline is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from ..formulations import BOUNDS

if TYPE_CHECKING:
    import casadi as ca
    from numpy.typing import NDArray

    from ..formulations import Tick
    from .situation import Situation

    Array = NDArray[np.float64]

Promise = Literal["joint bounds", "locked rows"]


@dataclass(frozen=True)
class Resolved:
    """What a baseline makes of a situation.

    Attributes
    ----------
    qd : ndarray, shape (nv,)
        Command [rad/s or m/s].
    iterations : int
        Passes that it took, as the method counts them.
    held : ndarray, shape (nv,), or None
        +1 where the method holds the joint at its upper side, -1 at its lower one, 0 elsewhere.
    sigma_min : float or None
        As `Situation.sigma_min`, where the method found it on its way.
    """

    qd: Array
    iterations: int = 1
    held: Array | None = None
    sigma_min: float | None = None

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the limits that held the command back, as a formulation calls them: "joint limits[3] upper"."""
        if self.held is None:
            return ()
        return tuple(
            f"joint limits[{i}] {'upper' if self.held[i] > 0.0 else 'lower'}" for i in np.flatnonzero(self.held)
        )


@dataclass(frozen=True)
class Baseline(ABC):
    """A closed-form way to turn the hand's velocity into joint velocities, to compare formulations with.

    A subclass is a frozen dataclass: it gives `name`, `promises` and `resolve`, and its fields are its options.

    Parameters
    ----------
    bounds : {"viable", "thesis"}
        How joint velocity bounds follow from the limits; see `kinqp.formulations.velocity_bounds`. A baseline that does
        not look at them is measured against them all the same.

    Notes
    -----
    `promises` says what the method holds by construction. What it promises is checked at every tick, and where it does
    not hold the safe stop is sent instead; what it does not promise is measured, reported and **sent**, because what
    such a method does to the arm is what one wants to see. See `kinqp.baselines.BaselineStep`.
    """

    bounds: str = "viable"

    name: ClassVar[str]
    promises: ClassVar[frozenset[Promise]]

    def __post_init__(self) -> None:
        if self.bounds not in BOUNDS:
            raise ValueError(f"bounds: expected one of {', '.join(BOUNDS)}, got {self.bounds!r}")

    @abstractmethod
    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:
        """Quantities of the tick that `resolve` needs beyond rows and bounds, by name; run-time inputs are made here.

        Parameters
        ----------
        tick : Tick
            Gives the symbols of the control cycle; what is asked of it here becomes an input of every step.
        """

    @abstractmethod
    def resolve(self, at: Situation) -> Resolved:
        """Compute the command.

        Parameters
        ----------
        at : Situation
            State, rows, bounds and run-time inputs.
        """
