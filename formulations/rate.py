"""The limit on how fast joint velocities change, and the slack by which it yields where it must."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca

from .bounds import velocity_bounds
from .singularity import largest

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

# Joints slow down for a limit with this share of `qdd_max`, so that the exact braking curve is not met but followed.
GENTLE: Final = 0.8
# The slack's curvature is chosen such that its shift is 3 at the default price: all lengths in the whitened QP stay
# near one, which is what a solver's tolerances are relative to.
_SHIFT: Final = 3.0
EXCESS: Final = "excess"


@dataclass(frozen=True)
class RateWindow:
    """Where the next joint velocities may lie, by the last ones.

    Attributes
    ----------
    low, high : ca.SX, shape (nv, 1)
        [rad/s or m/s].
    step : ca.SX, shape (nv, 1)
        qdd_max dt [rad/s or m/s].
    """

    low: ca.SX
    high: ca.SX
    step: ca.SX


def smoothing_time(tick: Tick, needed: ca.SX) -> ca.SX:
    r"""Time constant of the smoothing, scalar [s]: the longer, the more of `qdd_max` the rows need.

    Smoothed, a joint's acceleration passes zero with the slope of the wanted acceleration over the time constant. A
    slope that stays below 2 % of `qdd_max` per millisecond takes 50 ms where all of `qdd_max` is wanted, and none in
    addition to `smoothing_time` where the arm moves gently.

    Parameters
    ----------
    tick : Tick
        With the parameters `smoothing_time` and `smoothing_stretch`.
    needed : ca.SX, scalar
        As a share of `qdd_max`; see `governor`.
    """
    tau = tick.parameter("smoothing_time", 0.02, lowest=0.0, unit="s")
    return tau + tick.parameter("smoothing_stretch", 0.05, lowest=0.0, unit="s") * needed


def kept_share(tick: Tick, tau: ca.SX) -> ca.SX:
    """Share of the last command's error that is left after one period, tau / (tau + dt)."""
    return tau / (tau + tick.dt)


def rate_window(tick: Tick, tau: ca.SX | None) -> RateWindow:
    """Joint velocities within one period's acceleration of the last ones.

    Parameters
    ----------
    tick : Tick
    tau : ca.SX, scalar, or None
        Approach velocity and position limits exponentially, with this time constant [s]: the window's outer side is
        kept below the way to the limit as seen that time ahead, never asking for more than `qdd_max`. None: don't.
    """
    step = tick.qdd_max * tick.dt
    low, high = tick.qd_prev - step, tick.qd_prev + step
    if tau is None:
        return RateWindow(low, high, step)
    keep = kept_share(tick, tau)
    ahead = tick.q + 1.5 * tau * tick.qd_prev
    to_low, to_high = velocity_bounds(
        tick.bounds, ahead, tick.q_min, tick.q_max, tick.qd_max, GENTLE * tick.qdd_max, tick.dt
    )
    to_low = -ca.fmin(-to_low, ca.fmax(ahead - tick.q_min, 0) / ca.fmax(tau, tick.dt))
    to_high = ca.fmin(to_high, ca.fmax(tick.q_max - ahead, 0) / ca.fmax(tau, tick.dt))
    return RateWindow(
        ca.fmin(high, ca.fmax(low, keep * tick.qd_prev + (1 - keep) * to_low)),
        ca.fmax(low, ca.fmin(high, keep * tick.qd_prev + (1 - keep) * to_high)),
        step,
    )


def limit_rate(qp: QuadraticProgram, tick: Tick, qd: ca.SX, window: RateWindow) -> None:
    """Keep `qd` within the window, widened on all sides by `excess` >= 0 times one period's acceleration.

    The locked rows and the limits of position and velocity hold whatever it takes; where they leave no joint velocity
    within the window, the variable `excess` says by how many times `qdd_max` the acceleration has to exceed it, the
    same for all joints: the largest one is what is kept small. Its price is linear, so that it is exactly zero unless
    it is needed, as long as the price exceeds what the whole acceleration limit is worth to the objective:
    sum_i |J_i' W eps| qdd_max_i dt, 0.1 (m/s)^2 for all seven joints at an error of 1 m/s.

    Parameters
    ----------
    qp : QuadraticProgram
        Gets the variable, its term and the rows.
    qd : ca.SX, shape (nv, 1)
        The command, affine in the variables.
    """
    excess = qp.variable(EXCESS, 1)
    price = tick.parameter("excess_price", 1.0, lowest=0.0, positive=True, unit="m^2/s^2")
    qp.minimize(excess / _SHIFT + _SHIFT * price, name="excess acceleration")
    qp.between(0.0, excess, ca.inf, name="excess")
    qp.between(-ca.inf, qd - window.step * excess, window.high, name="rate upper")
    qp.between(window.low, qd + window.step * excess, ca.inf, name="rate lower")


def needed_excess(window: RateWindow, qd: ca.SX) -> ca.SX:
    """Smallest `excess` with which `qd` is admissible."""
    return ca.fmax(0, largest(ca.fmax(qd - window.high, window.low - qd) / window.step))


def scaled_last_command(tick: Tick) -> ca.SX:
    """N_c qd_prev scaled down to the bounds, shape (nv, 1): near the last command, within locked rows and limits."""
    last = tick.fixed.project(tick.qd_prev.T).T if tick.m_fixed else tick.qd_prev
    room = ca.if_else(last > 0, tick.qd_hi, -tick.qd_lo)
    return ca.fmin(1, -largest(-room / ca.fmax(ca.fabs(last), 1e-12))) * last
