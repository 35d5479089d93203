"""The symbols of one control cycle, made when first asked for so that what is not used is not generated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from .acceleration_bounds import acceleration_bounds, braking
from .algebra import matmul
from .bounds import BOUNDS, velocity_bounds
from .cuts import Cut, make_cut
from .inverse import FixedRows, factor_fixed_rows, robust_inverse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..robots import Robot, SymbolicKinematics
    from .modes import Mode

    Array = NDArray[np.float64]

DEFAULT_DT: Final = 1e-3


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
    """

    name: str
    symbol: ca.SX
    default: Array | None
    lowest: float
    unit: str
    positive: bool = False
    may_be_infinite: bool = False

    @cached_property
    def size(self) -> int:
        """Number of entries."""
        return int(self.symbol.size1())


class Tick:
    """What a formulation may build on: state, hand velocity, Jacobian rows, inverse, bounds, run-time parameters.

    Every quantity is a ``ca.SX`` column or matrix in SI units. `v` and `v_fixed` are counted along the mode's axes.

    Parameters
    ----------
    robot : Robot
        The arm; its limits are the defaults of the run-time inputs of the same names.
    mode : Mode
        Which rows of the twist are guided and which are locked.
    bounds : {"viable", "thesis"}
        How `qd_lo` and `qd_hi` follow from the limits.
    cut : bool
        Give null space, inverse and bounds as symbols, and say in `cuts` how to compute them: for generated C.
    """

    def __init__(self, robot: Robot, mode: Mode, bounds: str = "viable", *, cut: bool = False) -> None:
        if bounds not in BOUNDS:
            raise ValueError(f"bounds: expected one of {', '.join(BOUNDS)}, got {bounds!r}")
        self.robot: Final = robot
        self.mode: Final = mode
        self.bounds: Final = bounds
        self.cuts: Final[list[Cut]] = []
        self._cut: Final = cut
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
        unit: str = "-",
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
        unit : str
            For messages and generated comments.

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
        if value is not None and not (
            np.all(value > lowest if positive else value >= lowest) and (may_be_infinite or np.all(np.isfinite(value)))
        ):
            kind, bound = "" if may_be_infinite else "finite ", "above" if positive else "not below"
            raise ValueError(f"parameter {name}: expected a {kind}default {bound} {lowest:g}, got {default}")
        made = Input(name, ca.SX.sym(name, size), value, lowest, unit, positive, may_be_infinite)
        self._inputs[name] = made
        return made.symbol

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
        return self.parameter("dt", DEFAULT_DT, lowest=0.0, positive=True, unit="s")

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
        """Acceleration limits, shape (nv, 1) [rad/s^2 or m/s^2]."""
        return self._limit("qdd_max", self.robot.qdd_max, "rad/s^2 or m/s^2")

    @property
    def tau_max(self) -> ca.SX:
        """Torque or force limits, infinite where none is known, shape (nv, 1) [Nm or N]."""
        return self._limit("tau_max", self.robot.tau_max, "Nm or N", may_be_infinite=True)

    def _limit(self, name: str, default: Array, unit: str, *, may_be_infinite: bool = False) -> ca.SX:
        return self.parameter(
            name, default, size=self.nv, lowest=0.0, positive=True, may_be_infinite=may_be_infinite, unit=unit
        )

    def _computed(
        self, kernel: str, sizes: tuple[int, ...], inputs: tuple[ca.SX, ...], formulas: tuple[ca.SX, ...]
    ) -> tuple[ca.SX, ...]:
        """Results by their formulas or, in a tick that is cut, as symbols."""
        if not self._cut:
            return formulas
        self.cuts.append(make_cut(kernel, sizes, inputs, formulas))
        return self.cuts[-1].symbols

    @cached_property
    def _kinematics(self) -> SymbolicKinematics:
        return self.robot.symbolic(self.q)

    @cached_property
    def _dynamics(self) -> SymbolicKinematics:
        return self.robot.symbolic(self.q, self.qd_prev)

    @property
    def kinematics(self) -> SymbolicKinematics:
        """The arm's kinematics at `q`, world axes: of its links too, where a constraint needs more than the tool."""
        return self._kinematics

    @property
    def pose(self) -> ca.SX:
        """Pose of the tool centre point in the world, shape (4, 4) [m]."""
        return self._kinematics.pose

    @cached_property
    def J(self) -> ca.SX:
        """All six rows of the Jacobian along the mode's axes, shape (6, nv), translations first."""
        return self.mode.twist_map(self.pose) @ self._kinematics.jacobian

    @cached_property
    def Jdot_qd(self) -> ca.SX:
        """Time derivative of `J` times `qd_prev`, shape (6, 1) [m/s^2, rad/s^2]; pick rows as with `J`."""
        if self.mode.frame == "world" and not self.mode.depth:
            return self.mode.twist_map(self.pose) @ self._dynamics.jdot_qd
        return ca.jtimes(self.J @ self.qd_prev, self.q, self.qd_prev)

    @cached_property
    def J_free(self) -> ca.SX:
        """Rows that the hand guides, shape (m_free, nv)."""
        return self.J[list(self.mode.free_rows), :]

    @cached_property
    def J_fixed(self) -> ca.SX:
        """Rows that the mode locks, shape (m_fixed, nv)."""
        return self.J[list(self.mode.fixed_rows), :]

    @cached_property
    def fixed(self) -> FixedRows:
        """Orthonormal factors of the locked rows; meaningless where `m_fixed` is zero."""
        return factor_fixed_rows(self.J_fixed)

    @cached_property
    def _locked(self) -> tuple[ca.SX, ...]:
        """`J_bar`, `qd_fixed` and `v_left`, which share the factors of the locked rows."""
        if not self.m_fixed:
            return self.J_free, ca.SX(self.nv, 1), self.v
        qd_fixed = self.fixed.solve(self.v_fixed)
        formulas = (self.fixed.project(self.J_free), qd_fixed, self.v - matmul(self.J_free, qd_fixed))
        inputs = (self.J_free, self.J_fixed, self.v_fixed, self.v)
        return self._computed("locked_rows", (self.m_free, self.m_fixed, self.nv), inputs, formulas)

    @cached_property
    def J_bar(self) -> ca.SX:
        """Guided rows within the null space of the locked ones, J_free N_c, shape (m_free, nv)."""
        return self._locked[0]

    @property
    def inverse(self) -> ca.SX:
        """Singularity-robust inverse of `J_bar`, shape (nv, m_free); its columns never move the locked rows."""
        return self._inverse[0]

    @property
    def qd_task(self) -> ca.SX:
        """Joint velocity that gives the locked rows `v_fixed` and, where nothing is damped, the guided rows `v`.

        J# v_left + qd_fixed, shape (nv, 1) [rad/s or m/s].
        """
        return self._inverse[1]

    @cached_property
    def _inverse(self) -> tuple[ca.SX, ...]:
        threshold = self.parameter("damping_threshold", 0.08, lowest=0.0, positive=True, unit="m or rad")
        damping_max = self.parameter("damping_max", 0.05, lowest=0.0, positive=True, unit="m or rad")
        inverse = robust_inverse(self.J_bar, threshold, damping_max)
        formulas = (inverse, self.qd_fixed + matmul(inverse, self.v_left))
        inputs = (self.J_bar, threshold, damping_max, self.v_left, self.qd_fixed)
        return self._computed("robust_inverse", (self.m_free, self.nv), inputs, formulas)

    @cached_property
    def qd_fixed(self) -> ca.SX:
        """Smallest joint velocity that gives the locked rows `v_fixed`, shape (nv, 1) [rad/s or m/s]."""
        return self._locked[1]

    @property
    def v_left(self) -> ca.SX:
        """What `qd_fixed` leaves of `v` to do, shape (m_free, 1) [m/s, rad/s]: all, unless drift is corrected."""
        return self._locked[2]

    @cached_property
    def _bounds(self) -> tuple[ca.SX, ca.SX]:
        inputs = (self.q, self.q_min, self.q_max, self.qd_max, self.qdd_max, self.dt)
        lower, upper = self._computed(
            f"{self.bounds}_bounds", (self.nv,), inputs, velocity_bounds(self.bounds, *inputs)
        )
        return lower, upper

    @property
    def qd_lo(self) -> ca.SX:
        """Lower joint velocity bounds, shape (nv, 1), never positive [rad/s or m/s]."""
        return self._bounds[0]

    @property
    def qd_hi(self) -> ca.SX:
        """Upper joint velocity bounds, shape (nv, 1), never negative [rad/s or m/s]."""
        return self._bounds[1]

    @cached_property
    def _acceleration_bounds(self) -> tuple[ca.SX, ca.SX]:
        return acceleration_bounds(self.qd_prev, self.qd_lo, self.qd_hi, self.qdd_max, self.dt)

    @property
    def qdd_lo(self) -> ca.SX:
        """Lower joint acceleration bounds, shape (nv, 1); see `acceleration_bounds` [rad/s^2 or m/s^2]."""
        return self._acceleration_bounds[0]

    @property
    def qdd_hi(self) -> ca.SX:
        """Upper joint acceleration bounds, shape (nv, 1); see `acceleration_bounds` [rad/s^2 or m/s^2]."""
        return self._acceleration_bounds[1]

    @cached_property
    def qd_brake(self) -> ca.SX:
        """Fastest admissible braking from the last command, shape (nv, 1); see `braking` [rad/s or m/s]."""
        return braking(self.qd_prev, self.qd_lo, self.qd_hi, self.qdd_max, self.dt)

    @cached_property
    def qd_prev_free(self) -> ca.SX:
        """Part of `qd_prev` that does not move the locked rows, N_c qd_prev, shape (nv, 1) [rad/s or m/s]."""
        return self.fixed.project(self.qd_prev.T).T if self.m_fixed else self.qd_prev

    @property
    def M(self) -> ca.SX:
        """Joint-space mass matrix, shape (nv, nv) [kg m^2]."""
        return self._kinematics.mass_matrix

    @property
    def h(self) -> ca.SX:
        """Coriolis, centrifugal and gravity forces at `qd_prev`, shape (nv, 1) [Nm or N]."""
        return self._dynamics.bias_forces
