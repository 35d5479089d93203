"""The smallest acceleration with which a tick's locked rows and limits can be kept: what no formulation can avoid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np
from scipy.optimize import linprog

from ..formulations import velocity_bounds

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# An acceleration counts as over its limit where it is by more than this share.
OVER: Final = 1e-6


def least_acceleration(J_fixed: Array, qd_prev: Array, qd_lo: Array, qd_hi: Array, step: Array) -> float:
    r"""Smallest peak acceleration of all commands that a tick admits, as a share of the limits.

    .. math::
        \min_{\dot q}\ \max_i |\dot q - \dot q_{prev}|_i / (a_i\,dt)
        \quad\text{s.t.}\quad J_{fixed}\,\dot q = 0,\quad \dot q_{lo} \le \dot q \le \dot q_{hi}

    Above one, the acceleration limit can't be kept at this tick, whatever the command.

    Parameters
    ----------
    J_fixed : ndarray, shape (m_fixed, nv)
        Locked rows; dependent ones are dropped.
    qd_prev : ndarray, shape (nv,)
        Last command [rad/s or m/s].
    qd_lo, qd_hi : ndarray, shape (nv,)
        Bounds that contain zero [rad/s or m/s].
    step : ndarray, shape (nv,)
        qdd_max dt [rad/s or m/s].

    Raises
    ------
    ArithmeticError
        When the linear program is not solved, which bounds without zero inside would bring about.
    """
    nv = len(step)
    # In units of one period's acceleration, so that all entries are of one size.
    sides = np.vstack((np.column_stack((np.eye(nv), -np.ones(nv))), np.column_stack((-np.eye(nv), -np.ones(nv)))))
    last = qd_prev / step
    rows, levels = None, None
    if J_fixed.size:
        _, sigma, Vt = np.linalg.svd(J_fixed * step)
        basis = Vt[: int(np.sum(sigma > 1e-9 * sigma[0]))]
        rows, levels = np.column_stack((basis, np.zeros(len(basis)))), np.zeros(len(basis))
    cost = np.zeros(nv + 1)
    cost[-1] = 1.0
    result = linprog(
        cost, A_ub=sides, b_ub=np.concatenate((last, -last)), A_eq=rows, b_eq=levels,
        bounds=[*zip(qd_lo / step, qd_hi / step, strict=True), (0.0, None)], method="highs",
    )  # fmt: skip
    if result.status != 0:
        raise ArithmeticError(
            f"least_acceleration: expected bounds around zero, got a program that ended: {result.message}"
        )
    return float(result.fun)


def unforced_excess(
    J_fixed: Array, q: Array, commands: tuple[Array, Array], limits: tuple[Array, Array, Array, Array], dt: float
) -> float:
    """By how much a tick's acceleration is beyond both the limit and the least possible, as a share of the limit.

    Parameters
    ----------
    J_fixed : ndarray, shape (m_fixed, nv)
        Locked rows at `q`.
    q : ndarray, shape (nv,)
        State that the command was computed at [rad or m].
    commands : tuple of two ndarrays, shape (nv,)
        The one before, and the one looked at [rad/s or m/s].
    limits : tuple of four ndarrays, shape (nv,)
        q_min, q_max, qd_max, qdd_max.
    dt : float
        Control period [s].

    Raises
    ------
    ArithmeticError
        As of `least_acceleration`.
    """
    step = limits[3] * dt
    peak = float(np.max(np.abs(commands[1] - commands[0]) / step))
    if peak <= 1.0 + OVER:
        return 0.0
    sides = velocity_bounds("viable", *(ca.SX(ca.DM(each)) for each in (q, *limits, dt)))
    low, high = (np.array(ca.DM(side))[:, 0] for side in sides)
    return max(0.0, peak - max(1.0, least_acceleration(J_fixed, commands[0], low, high, step)))
