"""Joint acceleration bounds that fold position, velocity and acceleration limits into one interval per joint.

The command of an acceleration-level formulation is the velocity that its acceleration leads to within one period,
qd = qd_prev + dt qdd, held for that period: q + dt qd is where the joint is next (semi-implicit Euler). That is the
sampled model for which the `viable` velocity bounds are exact: the states from which a joint can stop before its limit
with at most `qdd_max` are those within the velocity bounds. What A. Del Prete (IEEE Robotics and Automation Letters
3(1), 2018) works out for joints whose acceleration is held over a period, a viable set and the interval of
accelerations that stays in it, is here one intersection per joint.
"""

from __future__ import annotations

import casadi as ca


def acceleration_bounds(qd_prev: ca.SX, qd_lo: ca.SX, qd_hi: ca.SX, qdd_max: ca.SX, dt: ca.SX) -> tuple[ca.SX, ca.SX]:
    r"""Lower and upper joint acceleration bounds at a state.

    .. math::
        \ddot q \in \big( [\dot q_{lo}, \dot q_{hi}] \cap [\dot q_{prev} - a\,dt,\ \dot q_{prev} + a\,dt]
        - \dot q_{prev} \big) / dt

    With the `viable` velocity bounds the intersection is not empty if the last command was within the velocity bounds
    of where it was given: b(d - qd dt) >= qd - a dt for every qd <= b(d). Hence once inside, always inside, and since
    zero is within the velocity bounds everywhere, braking at `qdd_max` reaches it.

    Where the intersection is empty (the arm was started beyond a limit or too fast, limits were changed, or the bounds
    are the `thesis` ones, which ask for more than `qdd_max`), position and velocity limits come first: the interval
    shrinks to the one velocity within [qd_lo, qd_hi] that is closest to what `qdd_max` allows. That is the
    gentlest braking that keeps those limits, and it exceeds `qdd_max`.

    Parameters
    ----------
    qd_prev : ca.SX, shape (nv, 1)
        Last command [rad/s or m/s].
    qd_lo, qd_hi : ca.SX, shape (nv, 1)
        Velocity bounds at the present position, from `velocity_bounds` [rad/s or m/s].
    qdd_max : ca.SX, shape (nv, 1)
        Acceleration limits, positive [rad/s^2 or m/s^2].
    dt : ca.SX, scalar
        Control period [s].

    Returns
    -------
    lower, upper : ca.SX, shape (nv, 1)
        Never crossed [rad/s^2 or m/s^2].
    """
    step = qdd_max * dt
    slowest = ca.fmin(ca.fmax(qd_prev - step, qd_lo), qd_hi)
    fastest = ca.fmax(ca.fmin(qd_prev + step, qd_hi), qd_lo)
    return (slowest - qd_prev) / dt, (fastest - qd_prev) / dt


def braking(qd_prev: ca.SX, qd_lo: ca.SX, qd_hi: ca.SX, qd_max: ca.SX, qdd_max: ca.SX, dt: ca.SX) -> ca.SX:
    """Command of the safe stop: as fast as `qdd_max` allows and no faster, shape (nv, 1) [rad/s or m/s].

    All joints are slowed down by one common factor, the smallest for which none brakes harder than `qdd_max`. The
    arm is at rest as soon as with every joint braking on its own (the joint that takes longest decides either way), but
    keeps its direction, so that the locked rows stay close to their values. A joint whose velocity bound asks for
    less than that is at its bound, as far as `qdd_max` lets it: from an admissible state it always does; from any
    other the joint brakes at `qdd_max` until it is there.

    Parameters
    ----------
    qd_prev, qd_lo, qd_hi, qdd_max, dt
        As in `acceleration_bounds`. A last command beyond `qd_max` counts as `qd_max`.
    qd_max : ca.SX, shape (nv, 1)
        Velocity limits, positive [rad/s or m/s].
    """
    last, step = ca.fmax(ca.fmin(qd_prev, qd_max), -qd_max), qdd_max * dt
    # 1 - a dt / |qd|, at a joint at rest as small as it gets; the offset is far below any speed that is one.
    factor = ca.fmax(ca.mmax(1 - step / (ca.fabs(last) + 1e-100)), 0)
    wanted = ca.fmin(ca.fmax(factor * last, qd_lo), qd_hi)
    return ca.fmin(ca.fmax(wanted, last - step), last + step)
