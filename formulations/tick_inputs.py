"""What one control cycle is given from outside: state, hand velocity, limits and parameters, as symbols."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..robots import Robot
    from .modes import Mode

    Array = NDArray[np.float64]

DEFAULT_DT: Final = 1e-3
# Control periods outside of this range are clocks that stand still or run wild, not control [s].
SHORTEST_DT: Final = 1e-5
LONGEST_DT: Final = 1.0
# A positive number is a normal one: the reciprocal of a smaller one may be infinite.
SMALLEST_POSITIVE: Final = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class Input:
    """One run-time input of a lowered formulation.

    Attributes
    ----------
    name : str
        As passed by keyword.
    symbol : ca.SX, shape (size, 1)
        Its symbol.
    default : ndarray, shape (size,), or None
        None: the caller must give it.
    lowest : float
        Smallest value that makes sense; a smaller one is refused.
    unit : str
        For messages and for the generated code's comments.
    positive : bool
        Whether `lowest` itself is refused too.
    may_be_infinite : bool
        Whether an infinite value is accepted ("no limit").
    highest : float
        Largest value that makes sense; a larger one is refused.
    example : ca.SX, shape (size, 1), or None
        A value that makes sense at a state, for inputs without a default; see `TickInputs.parameter`.
    """

    name: str
    symbol: ca.SX
    default: Array | None
    lowest: float
    unit: str
    positive: bool = False
    may_be_infinite: bool = False
    highest: float = np.inf
    example: ca.SX | None = None

    @cached_property
    def size(self) -> int:
        """Number of entries."""
        return int(self.symbol.size1())

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest value that is accepted."""
        largest = np.inf if self.may_be_infinite else float(np.finfo(float).max)
        lowest = max(self.lowest, SMALLEST_POSITIVE) if self.positive and self.lowest == 0.0 else self.lowest
        return max(lowest, -largest), min(self.highest, largest)

    def admits(self, value: Array) -> bool:
        """Whether all numbers are within `range`; NaN never is."""
        low, high = self.range
        return bool(((value >= low) & (value <= high)).all() and not (self.positive and (value <= self.lowest).any()))

    def describe_range(self) -> str:
        """Say which numbers are accepted, with the unit."""
        if self.highest < np.inf:
            return f"numbers from {self.lowest:g} to {self.highest:g} {self.unit}"
        if self.lowest == -np.inf:
            return f"{'' if self.may_be_infinite else 'finite '}numbers [{self.unit}]"
        return f"numbers {'above' if self.positive else 'not below'} {self.lowest:g} {self.unit}"


class TickInputs:
    """The run-time inputs of a control cycle, each made when first asked for; `Tick` computes with them.

    Parameters
    ----------
    robot : Robot
        The arm; its limits are the defaults of the run-time inputs of the same names.
    mode : Mode
        Which rows of the twist are guided and which are locked.
    """

    def __init__(self, robot: Robot, mode: Mode) -> None:
        self.robot: Final = robot
        self.mode: Final = mode
        self._inputs: dict[str, Input] = {}

    @property
    def nv(self) -> int:
        """Number of joints."""
        return self.robot.nv

    @property
    def m_free(self) -> int:
        """Number of guided rows."""
        return self.mode.m_free

    @property
    def m_fixed(self) -> int:
        """Number of locked rows."""
        return self.mode.m_fixed

    @property
    def inputs(self) -> tuple[Input, ...]:
        """The run-time inputs asked for so far, in that order."""
        return tuple(self._inputs.values())

    def parameter(
        self,
        name: str,
        default: float | Sequence[float] | Array | None,
        *,
        size: int = 1,
        lowest: float = -np.inf,
        positive: bool = False,
        may_be_infinite: bool = False,
        highest: float = np.inf,
        unit: str = "-",
        example: ca.SX | None = None,
    ) -> ca.SX:
        """Return the symbol of a run-time input; the same name gives the same symbol.

        Parameters
        ----------
        name : str
            As passed by keyword to a step.
        default : float, array of shape (size,), or None
            None: the caller must give it at every tick.
        size : int
            Number of entries.
        lowest : float
            Smallest value that makes sense.
        positive : bool
            Refuse `lowest` itself too.
        may_be_infinite : bool
            Accept infinite entries.
        highest : float
            Largest value that makes sense.
        unit : str
            For messages and generated comments.
        example : ca.SX, shape (size, 1), optional
            Where there is no default: a value that makes sense at a state, computed from `q` and from inputs that have
            a default. Nothing but checks runs with it, such as the recorded ticks of an export.

        Returns
        -------
        ca.SX, shape (size, 1)

        Raises
        ------
        ValueError
            When the name stands for another size already, or the default does not fit the size or the range.
        """
        known = self._inputs.get(name)
        if known is not None:
            if known.size != size:
                raise ValueError(f"parameter {name}: expected its first size, {known.size}, got {size}")
            return known.symbol
        value = None if default is None else np.broadcast_to(np.asarray(default, dtype=float), (size,)).copy()
        made = Input(name, ca.SX.sym(name, size), value, lowest, unit, positive, may_be_infinite, highest, example)
        if value is not None and not made.admits(value):
            raise ValueError(f"parameter {name}: expected as default {made.describe_range()}, got {default}")
        self._inputs[name] = made
        return made.symbol

    def declare_judged(self) -> None:
        """Make the inputs that every command is judged by, whatever the formulation uses: state, hand and limits."""
        for made in ("q", "v", "v_fixed", "dt", "q_min", "q_max", "qd_max", "qdd_max"):
            getattr(self, made)

    def declare_last_command(self) -> None:
        """Make the input that a safe stop by braking begins from, `qd_prev`."""
        self.parameter("qd_prev", None, size=self.nv, unit="rad/s or m/s")

    @property
    def q(self) -> ca.SX:
        """Joint positions, shape (nv, 1) [rad or m]."""
        return self.parameter("q", None, size=self.nv, unit="rad or m")

    @property
    def qd_prev(self) -> ca.SX:
        """Joint velocities of the tick before, shape (nv, 1) [rad/s or m/s]."""
        return self.parameter("qd_prev", None, size=self.nv, unit="rad/s or m/s")

    @property
    def qdd_prev(self) -> ca.SX:
        """Joint accelerations of the tick before, infinite where unknown, shape (nv, 1) [rad/s^2 or m/s^2]."""
        return self.parameter("qdd_prev", np.inf, size=self.nv, may_be_infinite=True, unit="rad/s^2 or m/s^2")

    @property
    def v(self) -> ca.SX:
        """Velocity that the hand asks for, shape (m_free, 1) [m/s, rad/s]."""
        return self.parameter("v", None, size=self.m_free, unit="m/s, rad/s")

    @property
    def v_fixed(self) -> ca.SX:
        """Velocity of the locked rows, shape (m_fixed, 1), zero unless drift is corrected [m/s, rad/s]."""
        return self.parameter("v_fixed", 0.0, size=self.m_fixed, unit="m/s, rad/s")

    @property
    def dt(self) -> ca.SX:
        """Control period [s]."""
        return self.parameter("dt", DEFAULT_DT, lowest=SHORTEST_DT, highest=LONGEST_DT, unit="s")

    @property
    def q_min(self) -> ca.SX:
        """Lower position limits, shape (nv, 1) [rad or m]."""
        return self.parameter("q_min", self.robot.q_min, size=self.nv, may_be_infinite=True, unit="rad or m")

    @property
    def q_max(self) -> ca.SX:
        """Upper position limits, shape (nv, 1) [rad or m]."""
        return self.parameter("q_max", self.robot.q_max, size=self.nv, may_be_infinite=True, unit="rad or m")

    @property
    def qd_max(self) -> ca.SX:
        """Velocity limits, shape (nv, 1) [rad/s or m/s]."""
        return self._limit("qd_max", self.robot.qd_max, "rad/s or m/s")

    @property
    def qdd_max(self) -> ca.SX:
        """Acceleration limits, infinite where there is none, shape (nv, 1) [rad/s^2 or m/s^2]."""
        return self._limit("qdd_max", self.robot.qdd_max, "rad/s^2 or m/s^2", may_be_infinite=True)

    @property
    def tau_max(self) -> ca.SX:
        """Torque or force limits, infinite where none is known, shape (nv, 1) [Nm or N]."""
        return self._limit("tau_max", self.robot.tau_max, "Nm or N", may_be_infinite=True)

    def _limit(self, name: str, default: Array, unit: str, *, may_be_infinite: bool = False) -> ca.SX:
        return self.parameter(
            name, default, size=self.nv, lowest=0.0, positive=True, may_be_infinite=may_be_infinite, unit=unit
        )
