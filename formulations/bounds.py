"""Joint velocity bounds that fold position, velocity and acceleration limits into one interval per joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal

import casadi as ca

if TYPE_CHECKING:
    from collections.abc import Callable

BoundsName = Literal["thesis", "viable"]


def thesis_bound(distance: ca.SX, qd_max: ca.SX, qdd_max: ca.SX, dt: ca.SX) -> ca.SX:
    """Largest velocity towards a limit that lies `distance` ahead, as the thesis has it (eq. 4.11, A.1).

    It follows the continuous-time braking curve sqrt(2 a d). Sampled, that asks for more deceleration than `qdd_max`.

    Parameters
    ----------
    distance : ca.SX, shape (nv, 1)
        Distance to the limit [rad or m]; beyond the limit (negative) the bound is zero.
    qd_max, qdd_max : ca.SX, shape (nv, 1)
        Velocity and acceleration limits [rad/s or m/s; rad/s^2 or m/s^2], positive; `qdd_max` may be infinite (none).
    dt : ca.SX, scalar
        Control period [s].

    Returns
    -------
    ca.SX, shape (nv, 1)
        Never negative [rad/s or m/s].

    Notes
    -----
    An acceleration of more than qd_max/dt, from the velocity limit to rest within one period, changes nothing: the
    bound is then the smaller of distance/dt and `qd_max`. It is capped there, so that an infinite one is no special
    case.
    """
    ahead = ca.fmax(distance, 0)
    a = ca.fmin(qdd_max, qd_max / dt)
    return ca.fmin(ca.fmin(ahead / dt, qd_max), ca.sqrt(2 * a * ahead))


def viable_bound(distance: ca.SX, qd_max: ca.SX, qdd_max: ca.SX, dt: ca.SX) -> ca.SX:
    r"""Largest velocity towards a limit from which the joint can still stop on it, in sampled time.

    With :math:`\delta = d/(a\,dt^2)`, :math:`m = \lfloor(\sqrt{1 + 8\delta} - 1)/2\rfloor` and
    :math:`\theta = (\delta - m(m+1)/2)/(m+1)` the bound is :math:`b(d) = a\,dt\,(m + \theta)`. It satisfies
    :math:`b(d - b\,dt) = b - a\,dt`: once inside always inside, landing on the limit with deceleration `a`, never more.

    Parameters, result and the cap on `qdd_max` are those of `thesis_bound`.
    """
    step = ca.fmin(qdd_max * dt, qd_max)  # velocity that one period of full braking takes away
    per_step = 1 / (step * dt)  # the only division that both sides of a joint share; divisions are what costs here
    # Beyond this distance qd_max is the smaller of the two; the cap keeps an absent limit (infinite distance) finite.
    periods = qd_max * dt * per_step
    delta = ca.fmin(ca.fmax(distance, 0) * per_step, 0.5 * periods * (periods + 1) + 1)
    m = ca.floor(0.5 * (ca.sqrt(1 + 8 * delta) - 1))
    # m + theta with theta put in: one division, and nothing cancels.
    return ca.fmin(step * (0.5 * m + delta / (m + 1)), qd_max)


BOUNDS: Final[dict[str, Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]]] = {
    "thesis": thesis_bound,
    "viable": viable_bound,
}


def velocity_bounds(
    name: str, q: ca.SX, q_min: ca.SX, q_max: ca.SX, qd_max: ca.SX, qdd_max: ca.SX, dt: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Lower and upper joint velocity bounds at `q`.

    Zero is always inside. A joint beyond a limit may not go further; the way back in is bounded by its distance to
    the opposite limit and by `qd_max`.

    Parameters
    ----------
    name : {"thesis", "viable"}
        Which braking curve.
    q, q_min, q_max, qd_max, qdd_max : ca.SX, shape (nv, 1)
        Position, its limits (infinite: none), velocity and acceleration limits [rad or m, .../s, .../s^2].
    dt : ca.SX, scalar
        Control period [s].

    Returns
    -------
    lower, upper : ca.SX, shape (nv, 1)
        [rad/s or m/s].
    """
    bound = BOUNDS[name]
    return -bound(q - q_min, qd_max, qdd_max, dt), bound(q_max - q, qd_max, qdd_max, dt)
