"""The symbols of one control cycle, made when first asked for so that what is not used is not generated."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Final

import casadi as ca

from .acceleration_bounds import acceleration_bounds, braking
from .algebra import matmul
from .bounds import BOUNDS, velocity_bounds
from .cuts import Cut, make_cut
from .inverse import FixedRows, factor_fixed_rows, robust_inverse
from .tick_inputs import TickInputs

if TYPE_CHECKING:
    from ..robots import Robot, SymbolicKinematics
    from .modes import Mode


class Tick(TickInputs):
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
        super().__init__(robot, mode)
        self.bounds: Final = bounds
        self.cuts: Final[list[Cut]] = []
        self._cut: Final = cut

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

    @property
    def qdd_usable(self) -> ca.SX:
        """Acceleration limits, at most what takes a joint from one velocity limit to the other within one period.

        More than that can't be used; unlike `qdd_max` it is finite, shape (nv, 1) [rad/s^2 or m/s^2].
        """
        return ca.fmin(self.qdd_max, 2 * self.qd_max / self.dt)

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
        """Fastest braking from the last command, shape (nv, 1); see `braking` [rad/s or m/s]."""
        limits = (self.qd_max, self.qdd_max, self.dt)
        return braking(self.qd_prev, *velocity_bounds("viable", self.q, self.q_min, self.q_max, *limits), *limits)

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
