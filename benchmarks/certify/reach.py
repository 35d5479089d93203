"""How far a limit must be for a velocity bound: the inverse of `kinqp.formulations.bounds`."""

from __future__ import annotations


def reach(bounds: str, bound: float, qdd_max: float, dt: float) -> float:
    """Distance to a limit at which the bound towards it is as given, as long as that is below the velocity limit.

    Parameters
    ----------
    bounds : {"viable", "thesis"}
        Which braking curve, see `kinqp.formulations.velocity_bounds`.
    bound : float
        Not negative [rad/s or m/s].
    qdd_max : float
        Acceleration limit [rad/s^2 or m/s^2].
    dt : float
        Control period [s].

    Returns
    -------
    float
        [rad or m].
    """
    if bounds == "thesis":
        return max(bound * dt, 0.5 * bound * bound / qdd_max)
    step = qdd_max * dt
    periods = bound // step
    rest = bound / step - periods
    return step * dt * (periods + 1.0) * (0.5 * periods + rest)
