"""What a hand-guiding controller can be set to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .position_observer import JUMP

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True, kw_only=True)
class GuidingSettings:
    """Defaults of the guiding law's run-time inputs; all of them can be changed while the controller runs.

    The documents give none of these numbers; they are this project's. A hand that pulls with 13 N moves the tool with
    0.2 m/s, which it reaches with a time constant of 67 ms.

    Attributes
    ----------
    admittance_mass : array_like, shape (6,)
        M along the mode's axes: translations, rotations [kg, kg m^2].
    admittance_damping : array_like, shape (6,)
        B likewise [N s/m, N m s/rad].
    force_dead_zone, torque_dead_zone : float
        Force and torque along the guided rows that move nothing [N], [N m].
    drift_gain : float
        Of the drift compensation; zero turns it off [1/s].
    drift_speed, drift_turn : float
        Most that it moves and turns the tool by [m/s], [rad/s].
    drift_dead_zone, drift_turn_dead_zone : float
        Errors that it leaves alone [m], [rad].
    stop_deceleration, stop_turn_deceleration : float
        What a tool that is brought to rest loses beyond what the damping takes, so that it gets there in finite time
        [m/s^2], [rad/s^2].
    limit_share : float
        Share of the acceleration limits with which changed velocity limits take effect: joints that the locked rows
        couple to one that is braked change faster than it does [-].
    observer_gain, observer_jump : float
        Of the observer of joint positions (`PositionObserver`): what a measurement counts for, above 0 [-]; with 1 or
        more there is no observer. A measurement further than this from what is expected is believed at once [rad or m].
    max_failures : int
        So many ticks in a row whose QP is not solved, or that have no usable sample, end in a stop.
    hold_ticks : int
        So many ticks in a row a sample (`q`, wrench) that is not finite is replaced by the last wrench and by where the
        last command has taken the arm. After that the arm brakes until there is one.

    Raises
    ------
    ValueError
        Naming the setting, what was expected and what was got.
    """

    admittance_mass: ArrayLike = (4.0, 4.0, 4.0, 0.08, 0.08, 0.08)
    admittance_damping: ArrayLike = (60.0, 60.0, 60.0, 1.2, 1.2, 1.2)
    force_dead_zone: float = 1.0
    torque_dead_zone: float = 0.05
    drift_gain: float = 10.0
    drift_speed: float = 0.01
    drift_turn: float = 0.05
    drift_dead_zone: float = 1e-5
    drift_turn_dead_zone: float = 1e-5
    stop_deceleration: float = 0.5
    stop_turn_deceleration: float = 2.0
    limit_share: float = 0.2
    observer_gain: float = 1.0
    observer_jump: float = JUMP
    max_failures: int = 20
    hold_ticks: int = 5

    def __post_init__(self) -> None:
        for name in ("admittance_mass", "admittance_damping"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != (6,) or not (np.isfinite(value).all() and (value > 0.0).all()):
                raise ValueError(f"{name}: expected 6 positive numbers, got {getattr(self, name)!r}")
            object.__setattr__(self, name, tuple(map(float, value)))
        for name in _POSITIVE:
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise ValueError(f"{name}: expected a positive number, got {getattr(self, name)!r}")
        for name in _NOT_NEGATIVE:
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise ValueError(f"{name}: expected a number that is not negative, got {getattr(self, name)!r}")
        for name, least in (("max_failures", 1), ("hold_ticks", 0)):
            count = getattr(self, name)
            if isinstance(count, bool) or not np.isfinite(count) or count != int(count) or count < least:
                raise ValueError(f"{name}: expected a count of at least {least}, got {count!r}")


_POSITIVE = (
    *("stop_deceleration", "stop_turn_deceleration", "limit_share"),
    *("observer_gain", "observer_jump"),
)
_NOT_NEGATIVE = (
    *("force_dead_zone", "torque_dead_zone", "drift_gain", "drift_speed", "drift_turn"),
    *("drift_dead_zone", "drift_turn_dead_zone"),
)
