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
# The slacks' curvature is chosen such that the shift is 3 at a price of one: all lengths in the whitened QP stay
# not far from one, which is what a solver's tolerances are relative to.
_SHIFT: Final = 3.0
EXCESS: Final = "excess"
HASTE: Final = "haste"
# A hundred to one: with ten to one accelerations still passed their limit by 1 % for comfort's sake.
EXCESS_PRICE: Final = 10.0
HASTE_PRICE: Final = 0.1
# At this rate an acceleration changes by 1.7 % of its limit in a tick of 1 ms: less than the 2 % between 1 % on either
# side of zero, where a change of sign begins to count.
JERK_TIME: Final = 0.06
# With it a joint's braking for its limit takes half of that jerk, and leaves something to others.
LIMIT_TIME: Final = 0.1
# Accelerations from here on say that none is known.
_UNKNOWN: Final = 1e100


@dataclass(frozen=True)
class RateWindow:
    """Where the next joint velocities may lie, by the last ones.

    Attributes
    ----------
    low, high : ca.SX, shape (nv, 1)
        Within the acceleration limit, the jerk limit and a gentle approach to limits [rad/s or m/s].
    slowest, fastest : ca.SX, shape (nv, 1)
        Within the acceleration limit alone [rad/s or m/s].
    step : ca.SX, shape (nv, 1)
        qdd_max dt, at most what can be used of it (`Tick.qdd_usable`) [rad/s or m/s].
    """

    low: ca.SX
    high: ca.SX
    slowest: ca.SX
    fastest: ca.SX
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


def rate_window(tick: Tick, tau: ca.SX | None, *, jerk: bool = False) -> RateWindow:
    """Joint velocities within one period's acceleration of the last ones.

    Parameters
    ----------
    tick : Tick
        With the parameter `limit_time` where there is smoothing, `jerk_time` and `qdd_prev` where jerk is limited.
    tau : ca.SX, scalar, or None
        Approach velocity and position limits exponentially, with this time constant or, if that is longer,
        `limit_time` [s]: the window's outer side is kept below the way to the limit as seen that time ahead, never
        asking for more than `qdd_max`. None: don't.
    jerk : bool
        Keep the acceleration near the last one, too: it takes `jerk_time` to get from nothing to `qdd_max`. Where the
        locked rows themselves change the last command's continuation by more than that, by twice as much.
    """
    step = tick.qdd_usable * tick.dt
    slowest, fastest = tick.qd_prev - step, tick.qd_prev + step
    low, high = slowest, fastest
    if jerk:
        time = tick.parameter("jerk_time", JERK_TIME, lowest=0.0, positive=True, unit="s")
        onward = continued(tick)
        forced = onward - tick.fixed.project(onward.T).T if tick.m_fixed else ca.SX(tick.nv, 1)
        share = tick.dt / time + 2 * largest(ca.fabs(forced) / step)
        known = ca.fabs(tick.qdd_prev) < _UNKNOWN
        low = ca.if_else(known, ca.fmin(ca.fmax(low, onward - share * step), high), low)
        high = ca.if_else(known, ca.fmax(ca.fmin(high, onward + share * step), low), high)
    if tau is not None:
        tau = ca.fmax(tau, tick.parameter("limit_time", LIMIT_TIME, lowest=0.0, unit="s"))
        keep = kept_share(tick, tau)
        ahead = tick.q + 1.5 * tau * tick.qd_prev
        to_low, to_high = velocity_bounds(
            tick.bounds, ahead, tick.q_min, tick.q_max, tick.qd_max, GENTLE * tick.qdd_max, tick.dt
        )
        to_low = -ca.fmin(-to_low, ca.fmax(ahead - tick.q_min, 0) / ca.fmax(tau, tick.dt))
        to_high = ca.fmin(to_high, ca.fmax(tick.q_max - ahead, 0) / ca.fmax(tau, tick.dt))
        low, high = (
            ca.fmin(high, ca.fmax(low, keep * tick.qd_prev + (1 - keep) * to_low)),
            ca.fmax(low, ca.fmin(high, keep * tick.qd_prev + (1 - keep) * to_high)),
        )
    return RateWindow(low, high, slowest, fastest, step)


def continued(tick: Tick) -> ca.SX:
    """Joint velocities that the last acceleration leads to, shape (nv, 1); the last ones where it is unknown."""
    step = tick.qdd_usable * tick.dt
    last = ca.if_else(ca.fabs(tick.qdd_prev) < _UNKNOWN, tick.dt * tick.qdd_prev, 0)
    return tick.qd_prev + ca.fmax(-step, ca.fmin(step, last))


def limit_rate(qp: QuadraticProgram, tick: Tick, qd: ca.SX, window: RateWindow) -> None:
    """Keep `qd` within the window, as far as what comes first allows it.

    The locked rows and the limits of position and velocity hold whatever it takes. Where they leave no joint velocity
    within the acceleration limit, the variable `excess` says by how many times `qdd_max` it has to be exceeded;
    where none within the window, `haste` does, for the window alone. Both are the same for all joints: the largest one
    is what is kept small. Their prices are linear, so that they are exactly zero unless needed, as long as the price
    exceeds what the whole acceleration limit is worth to the objective: sum_i |J_i' W eps| qdd_max_i dt, 0.1 (m/s)^2
    for all seven joints at an error of 1 m/s. Haste is cheaper: accelerations don't pass their limit for comfort.

    Parameters
    ----------
    qp : QuadraticProgram
        Gets the variables, their terms and the rows.
    qd : ca.SX, shape (nv, 1)
        The command, affine in the variables.
    """
    price = tick.parameter("excess_price", EXCESS_PRICE, lowest=0.0, positive=True, unit="m^2/s^2")
    cheaper = tick.parameter("haste_price", HASTE_PRICE, lowest=0.0, positive=True, unit="m^2/s^2")
    excess, haste = qp.variable(EXCESS, 1), qp.variable(HASTE, 1)
    qp.minimize(excess / _SHIFT + _SHIFT * price, name="excess acceleration")
    qp.minimize(haste / _SHIFT + _SHIFT * cheaper, name="haste")
    qp.between(0.0, excess, ca.inf, name="excess")
    qp.between(0.0, haste, ca.inf, name="haste")
    wider, wide = window.step * (excess + haste), window.step * excess
    qp.between(-ca.inf, qd - wider, window.high, name="calm upper")
    qp.between(window.low, qd + wider, ca.inf, name="calm lower")
    qp.between(-ca.inf, qd - wide, window.fastest, name="rate upper")
    qp.between(window.slowest, qd + wide, ca.inf, name="rate lower")


def needed_slacks(window: RateWindow, qd: ca.SX) -> dict[str, ca.SX]:
    """Smallest `excess`, and with it smallest `haste`, with which `qd` is admissible."""
    excess = _beyond(window.slowest, qd, window.fastest, window.step)
    return {EXCESS: excess, HASTE: ca.fmax(0, _beyond(window.low, qd, window.high, window.step) - excess)}


def _beyond(low: ca.SX, qd: ca.SX, high: ca.SX, step: ca.SX) -> ca.SX:
    return ca.fmax(0, largest(ca.fmax(qd - high, low - qd) / step))


def scaled_last_command(tick: Tick) -> ca.SX:
    """N_c qd_prev scaled down to the bounds, shape (nv, 1): near the last command, within locked rows and limits."""
    last = tick.fixed.project(tick.qd_prev.T).T if tick.m_fixed else tick.qd_prev
    room = ca.if_else(last > 0, tick.qd_hi, -tick.qd_lo)
    return ca.fmin(1, -largest(-room / ca.fmax(ca.fabs(last), 1e-12))) * last
