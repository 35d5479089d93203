"""What a real arm adds to a path: speed, noise, lag; and an observer against it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

SPEED: Final = 0.15


@dataclass(frozen=True)
class Disturbance:
    """What a real arm adds.

    Attributes
    ----------
    name : str
    speed : float
        Hand speed [m/s].
    noise : float
        Standard deviation of the measured joint positions [rad].
    lag : float
        Time constant with which the joints follow the command, zero for at once [s].
    observer_gain : float
        Of the `PositionObserver` between encoders and step; 1 for none [-].
    """

    name: str = "as it is"
    speed: float = SPEED
    noise: float = 0.0
    lag: float = 0.0
    observer_gain: float = 1.0


DISTURBANCES: Final = (
    Disturbance("noise 1e-5 rad", noise=1e-5),
    Disturbance("lag 10 ms", lag=0.01),
    Disturbance("noise and lag", noise=1e-5, lag=0.01),
    Disturbance("noise, observed", noise=1e-5, observer_gain=0.05),
    Disturbance("noise and lag, observed", noise=1e-5, lag=0.01, observer_gain=0.05),
    Disturbance("0.5 m/s", speed=0.5),
)
