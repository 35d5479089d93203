"""Whether a command keeps what is promised of it: measured alike, whoever computed it.

`CommandCheck` measures a command against the bounds and rows of its tick. `unmet_limits` is the gate's own look at the
limits: it knows the state, the limits and the command, and nothing that was computed from them before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# What the application promises of the locked rows, relative to the speed they compensate [-].
FIXED_TOLERANCE: Final = 1e-9
# Where less than this is compensated in a locked row, it is judged absolutely [m/s, rad/s].
FIXED_FLOOR: Final = 1.0
# What a joint velocity may exceed its bounds by [rad/s or m/s]: a thousandth of the encoder noise of a good arm over
# 1 ms, and above the primal tolerance of an interior-point solver asked for 1e-9.
BOUND_TOLERANCE: Final = 1e-8


@dataclass(frozen=True)
class CommandCheck:
    """How far a command is off.

    Attributes
    ----------
    fixed_error : float
        Largest error of a locked row; infinite where the command is not finite [m/s, rad/s].
    bound_violation : float
        Largest excess over a joint velocity bound; infinite likewise [rad/s or m/s].
    joint_bounds, locked_rows : str
        One sentence where they are exceeded by more than is tolerated, else empty.
    """

    fixed_error: float
    bound_violation: float
    joint_bounds: str
    locked_rows: str

    @classmethod
    def of(cls, qd: Array, J_fixed: Array, v_fixed: Array, qd_lo: Array, qd_hi: Array) -> CommandCheck:
        """Measure a command, shape (nv,); the locked rows are to have the velocities `v_fixed`."""
        if not np.isfinite(qd).all():
            return cls(np.inf, np.inf, "", "")
        residual = np.abs(J_fixed @ qd - v_fixed)
        share = np.abs(J_fixed) @ np.abs(qd) + np.abs(v_fixed)
        # Methods, not functions: this is called at every tick, and half of such a function's time is on the way to it.
        fixed_error = float(residual.max(initial=0.0))
        bound_violation = float(np.maximum(qd - qd_hi, qd_lo - qd).max(initial=0.0))
        off = bool((residual > FIXED_TOLERANCE * np.maximum(share, FIXED_FLOOR)).any())
        return cls(
            fixed_error,
            bound_violation,
            f"a joint exceeds its velocity bound by {bound_violation:.1e}" if bound_violation > BOUND_TOLERANCE else "",
            f"a locked row is off by {fixed_error:.1e}" if off else "",
        )


class Limits(NamedTuple):
    """Where an arm is and what it may do; arrays of shape (nv,).

    Attributes
    ----------
    q, q_min, q_max : ndarray
        Position and its limits, infinite where there is none [rad or m].
    qd_max, qdd_max : ndarray
        Velocity limits; acceleration limits, infinite where there is none [rad/s or m/s; rad/s^2 or m/s^2].
    dt : float
        Control period [s].
    qd_prev : ndarray or None
        Last command; None where the step is not told [rad/s or m/s].
    """

    q: Array
    q_min: Array
    q_max: Array
    qd_max: Array
    qdd_max: Array
    dt: float
    qd_prev: Array | None = None


def unmet_limits(qd: Array, limits: Limits, *, sampled: bool, acceleration: bool = False) -> str:
    """Say which limit a command of shape (nv,) does not keep, to `BOUND_TOLERANCE`; empty where it keeps them all.

    A joint that moves must be able to stop before the limit that it moves towards: in sampled time, with at most
    `qdd_max` (`sampled`, the `viable` bounds), or as the continuous braking curve has it (the `thesis` ones). A joint
    that stands still keeps every limit, also beyond one. `acceleration`: it must be within `qdd_max` of the last
    command, too.
    """
    q, q_min, q_max, qd_max, qdd_max, dt, qd_prev = limits
    if not np.isfinite(qd).all():
        return "the command is not finite"
    counted = np.maximum(np.abs(qd) - BOUND_TOLERANCE, 0.0)
    if (counted > qd_max).any():
        return f"a joint exceeds its velocity limit by {float((np.abs(qd) - qd_max).max()):.1e}"
    distance = np.where(qd > 0.0, q_max - q, q - q_min)
    step = np.minimum(qdd_max * dt, qd_max)
    if sampled:
        periods = np.floor(counted / step)
        way = dt * ((periods + 1.0) * counted - 0.5 * step * periods * (periods + 1.0))
    else:
        way = np.maximum(counted * dt, counted * counted * dt / (2.0 * step))
    if ((counted > 0.0) & ~(way <= distance)).any():
        return f"joint {int(((counted > 0.0) & ~(way <= distance)).argmax())} could not stop before its position limit"
    if acceleration and qd_prev is not None:
        excess = np.abs(qd - qd_prev) - qdd_max * dt
        if not (excess <= BOUND_TOLERANCE).all():
            return f"a joint exceeds its acceleration limit by {float(excess.max()) / dt:.1e}"
    return ""
