"""The guiding law: all of a hand-guiding controller that comes before the QP, declared once for Python and for C."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Final

import casadi as ca

from ..formulations import Tick
from ..formulations.acceleration_bounds import braking
from ..formulations.bounds import velocity_bounds
from .admittance import admit, outside_dead_zone, slowed, wrench_along
from .drift import correction, pose_error
from .position_observer import observed

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..formulations import Input, Mode
    from ..robots import Robot
    from .guiding_settings import GuidingSettings

#: What the controller itself hands to the law at every tick; all other inputs of a law are settings or limits.
HANDED: Final = ("q", "wrench", "hand_velocity", "anchor", "qd_prev", "qd_limit", "stopping", "q_observed")


class GuidingLaw:
    """From the hand's wrench to what the QP is asked, in one mode.

    Parameters
    ----------
    robot : Robot
        The arm.
    mode : Mode
        Motion mode.
    settings : GuidingSettings
        Defaults of the run-time inputs.

    Attributes
    ----------
    law : dict of str to ca.SX
        `v`, shape (m_free, 1): velocity asked for, by admittance, or on its way to zero while `stopping`;
        `v_fixed`, (m_fixed, 1): drift compensation; `qd_limit`, (nv, 1): joint velocity limits of this tick, on their
        way to `qd_max`; `drift`, (2, 1): distance and angle of the locked rows from the anchor [m, rad].
    observed : dict of str to ca.SX
        `observed`, (nv, 1): joint positions by the observer, from `q` as measured and the last ones, `q_observed`. What
        is called `q` in all others is this.
    anchor : dict of str to ca.SX
        `anchor`, (12, 1): rotation and position at `q`, column by column.
    guided : dict of str to ca.SX
        `v`, (m_free, 1): velocity that `qd_prev` gives along the guided rows.
    brake : dict of str to ca.SX
        `qd`, (nv, 1): braking from `qd_prev`, as fast as the acceleration limits allow, within `qd_limit`.
    """

    def __init__(self, robot: Robot, mode: Mode, settings: GuidingSettings) -> None:
        self.robot: Final = robot
        self.mode: Final = mode
        self._settings: Final = settings
        tick = Tick(robot, mode)
        self._tick: Final = tick
        # First of all, so that inputs come in one order whatever a mode makes use of.
        _ = tick.q, tick.qd_prev, tick.dt, tick.qd_max, tick.qdd_max
        self.law: Final = self._declare()
        self.observed: Final = {"observed": self._observe()}
        self.anchor: Final = {"anchor": ca.vec(tick.pose[:3, :])}
        self.guided: Final = {"v": tick.J_free @ tick.qd_prev}
        # The last command counts as it was sent, also where velocity limits are on their way below it.
        last = tick.parameter("qd_limit", None, size=tick.nv, unit="rad/s or m/s")
        limits = (ca.fmax(last, ca.fabs(tick.qd_prev)), tick.qdd_max, tick.dt)
        bounds = velocity_bounds("viable", tick.q, tick.q_min, tick.q_max, *limits)
        self.brake: Final = {"qd": braking(tick.qd_prev, *bounds, *limits)}

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Its run-time inputs."""
        return self._tick.inputs

    @property
    def settable(self) -> tuple[Input, ...]:
        """Those of them that a user sets: settings and limits."""
        return tuple(given for given in self.inputs if given.name not in (*HANDED, "dt"))

    def symbols_of(self, expressions: dict[str, ca.SX]) -> dict[str, ca.SX]:
        """Give the inputs that expressions depend on, by name."""
        needed = {symbol.name() for symbol in ca.symvar(ca.vertcat(*map(ca.vec, expressions.values())))}
        return {
            given.name: given.symbol
            for given in self.inputs
            if any(given.symbol[i].name() in needed for i in range(given.size))
        }

    @cached_property
    def _qd_limit(self) -> ca.SX:
        """Limits on their way to `qd_max`, with `limit_share` of the acceleration limits.

        Down, from where the joint is if it is slower than the limit; up, so that a joint that was held back is let go.
        """
        tick = self._tick
        last = tick.parameter("qd_limit", None, size=tick.nv, unit="rad/s or m/s")
        step = self._setting("limit_share", "-", positive=True) * tick.qdd_max * tick.dt
        down = ca.fmax(tick.qd_max, ca.fmin(last, ca.fabs(tick.qd_prev)) - step)
        return ca.if_else(tick.qd_max < last, down, ca.fmin(tick.qd_max, last + step))

    def _observe(self) -> ca.SX:
        tick = self._tick
        last = tick.parameter("q_observed", None, size=tick.nv, unit="rad or m")
        gain = self._setting("observer_gain", "-", positive=True)
        jump = self._setting("observer_jump", "rad or m", positive=True)
        return observed(tick.q, last, tick.qd_prev, gain, jump, tick.dt)

    def _declare(self) -> dict[str, ca.SX]:
        tick, mode = self._tick, self.mode
        free, fixed = list(mode.free_rows), list(mode.fixed_rows)
        wrench = tick.parameter("wrench", None, size=6, unit="N, N m")
        before = tick.parameter("hand_velocity", None, size=tick.m_free, unit="m/s, rad/s")
        anchor = ca.reshape(tick.parameter("anchor", None, size=12, unit="m"), 3, 4)
        stopping = tick.parameter("stopping", None, unit="flag")
        mass = self._setting("admittance_mass", "kg, kg m^2", size=6, positive=True)
        damping = self._setting("admittance_damping", "N s/m, N m s/rad", size=6, positive=True)

        force = wrench_along(mode, tick.pose, wrench)[free]
        zones = (
            self._setting("force_dead_zone", "N"),
            self._setting("torque_dead_zone", "N m"),
        )
        pulled = _by_kind(mode.free_rows, force, outside_dead_zone, [(zone,) for zone in zones])
        v = admit(before, (1 - stopping) * pulled, mass[free], damping[free], tick.dt)
        losses = (
            self._setting("stop_deceleration", "m/s^2", positive=True),
            self._setting("stop_turn_deceleration", "rad/s^2", positive=True),
        )
        v = _by_kind(mode.free_rows, v, slowed, [(stopping * loss * tick.dt,) for loss in losses])

        error = pose_error(mode, tick.pose, anchor)
        gain = self._setting("drift_gain", "1/s")
        most = (self._setting("drift_speed", "m/s"), self._setting("drift_turn", "rad/s"))
        least = (self._setting("drift_dead_zone", "m"), self._setting("drift_turn_dead_zone", "rad"))
        back = _by_kind(
            mode.fixed_rows,
            error[fixed] if fixed else ca.SX(0, 1),
            correction,
            [(zone, gain, speed, tick.dt) for zone, speed in zip(least, most, strict=True)],
        )
        lengths = [ca.norm_2(error[rows]) if rows else ca.SX(0) for rows in _kinds(mode.fixed_rows)]
        return {"v": v, "v_fixed": back, "qd_limit": self._qd_limit, "drift": ca.vertcat(*lengths)}

    def _setting(self, name: str, unit: str, *, size: int = 1, positive: bool = False) -> ca.SX:
        default = getattr(self._settings, name)
        return self._tick.parameter(name, default, size=size, lowest=0.0, positive=positive, unit=unit)


def _kinds(rows: Sequence[int]) -> tuple[list[int], list[int]]:
    """Translations and rotations among rows of the twist."""
    return [row for row in rows if row < 3], [row for row in rows if row >= 3]


def _by_kind(
    rows: Sequence[int], vector: ca.SX, function: Callable[..., ca.SX], arguments: Sequence[tuple[ca.SX, ...]]
) -> ca.SX:
    """Apply a function to the translations and to the rotations in a vector of such rows, each with its arguments."""
    result = ca.SX(vector.size1(), 1)
    for kind, given in zip(_kinds(rows), arguments, strict=True):
        places = [index for index, row in enumerate(rows) if row in kind]
        if places:
            result[places] = function(vector[places], *given)
    return result
