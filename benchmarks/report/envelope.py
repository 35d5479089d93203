"""The area of admissible joint velocities (thesis, figure 4.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from ...formulations.bounds import BOUNDS, velocity_bounds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..scenarios import Scenario

    Array = NDArray[np.float64]

_POINTS: Final = 161


@dataclass(frozen=True)
class Envelope:
    """Velocity bounds of one joint over its range.

    Attributes
    ----------
    joint : int
        From 0.
    unit : str
        "deg" or "mm": what positions are shown in.
    q : ndarray, shape (N,)
        Positions [unit], dense towards both limits.
    bounds : dict
        Name of the braking curve to its lower and upper bounds, shape (N,) each [unit/s].
    """

    joint: int
    unit: str
    q: Array
    bounds: dict[str, tuple[Array, Array]]


def unit_of(scenario: Scenario, joint: int) -> tuple[str, float]:
    """Unit that a joint's position is shown in, and how many of it make one rad or m."""
    # A revolute joint turns the tool whatever the state, a prismatic one never.
    turns = bool(np.any(scenario.robot.jacobian(scenario.q0)[3:, joint]))
    return ("deg", 180.0 / np.pi) if turns else ("mm", 1e3)


def envelope(scenario: Scenario, joint: int) -> Envelope | None:
    """Area of admissible velocities of a joint under a scenario's limits; none for a joint without position limits.

    Parameters
    ----------
    scenario : Scenario
        Its `inputs` override the robot's limits, as they do in the run.
    joint : int
        From 0.

    Returns
    -------
    Envelope or None
    """
    limits = {name: float(scenario.limit(name)[joint]) for name in ("q_min", "q_max", "qd_max", "qdd_max")}
    low, high = limits["q_min"], limits["q_max"]
    if not (np.isfinite(low) and np.isfinite(high)):
        return None
    # Cosine spacing: the curves bend at the limits.
    q = low + (high - low) * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, _POINTS)))
    unit, scale = unit_of(scenario, joint)
    bounds = {name: _bounds(name, q, limits, scenario.dt, scale) for name in BOUNDS}
    return Envelope(joint, unit, scale * q, bounds)


def _bounds(name: str, q: Array, limits: dict[str, float], dt: float, scale: float) -> tuple[Array, Array]:
    at = ca.SX.sym("q")
    q_min, q_max, qd_max, qdd_max = (ca.SX(limits[key]) for key in ("q_min", "q_max", "qd_max", "qdd_max"))
    both = velocity_bounds(name, at, q_min, q_max, qd_max, qdd_max, ca.SX(dt))
    lower, upper = ca.Function("bounds", [at], list(both))(q[None, :])
    return scale * np.array(lower).ravel(), scale * np.array(upper).ravel()
