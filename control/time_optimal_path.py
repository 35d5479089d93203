r"""The fastest motion along a joint path that does not stop, under limits on velocity and acceleration.

With b = ds/dt squared over the path's parameter s, the joint velocities are q' sqrt(b) and the accelerations
q' b'/2 + q'' b, so that all limits are linear in b and its slope, and the time, the integral of 1/sqrt(b), is convex.
Source: Verscheure, Demeulenaere, Swevers, De Schutter, Diehl, "Time-Optimal Path Tracking for Robots: A Convex
Optimization Approach", IEEE Trans. Automatic Control 54(10), 2009.
"""

from __future__ import annotations

from importlib import import_module
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from .trajectories import JointTrajectory, checked_job

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.interpolate import PchipInterpolator

    Array = NDArray[np.float64]

# Cells of the grid per piece of the path.
_CELLS: Final = 4


def time_optimal_path(points: ArrayLike, qd_max: ArrayLike, qdd_max: ArrayLike, *, dt: float = 1e-3) -> JointTrajectory:
    """Pass through the points without stopping, from rest to rest, as fast as limits allow.

    The path between the points is a monotone piecewise cubic (PCHIP): its tangent is continuous and no joint leaves
    the range of two neighbouring points, so that points within limits make a path within limits. Time along it is
    optimal on a grid of four cells a piece; what the limits are exceeded by between grid points is taken back by
    slowing the whole down. Where the points turn sharply, stopping at them can be faster.

    Parameters
    ----------
    points : array_like, shape (N, nv)
        Joint positions; repeated ones count once [rad or m].
    qd_max, qdd_max : array_like, shape (nv,)
        Limits [rad/s or m/s; rad/s^2 or m/s^2].
    dt : float
        Period of the samples; the end is one too [s].

    Returns
    -------
    JointTrajectory

    Raises
    ------
    ValueError
        When an input has the wrong shape or is out of range.
    RuntimeError
        When the solver fails.
    """
    from scipy.interpolate import PchipInterpolator

    way, speed, acceleration = checked_job(points, qd_max, qdd_max, dt)
    # Parameter: the time that the slowest joint needs at full speed; ds/dt is then about 1 at most.
    lengths = np.max(np.abs(np.diff(way, axis=0)) / speed, axis=1, initial=0.0)
    way = way[np.concatenate([[True], lengths > 0.0])]
    if len(way) < 2:
        raise ValueError("points: expected at least 2 that differ, got fewer")
    knots = np.concatenate([[0.0], np.cumsum(lengths[lengths > 0.0])])
    path = PchipInterpolator(knots, way)
    grid = np.concatenate([np.linspace(a, b, _CELLS, endpoint=False) for a, b in pairwise(knots)])
    grid = np.append(grid, knots[-1])
    squared = _fastest(path, grid, speed, acceleration)
    times, s, rate, slope = _sample(grid, squared, dt)
    q, first, second = path(s), path(s, 1), path(s, 2)
    qd, qdd = first * rate[:, None], second * (rate**2)[:, None] + first * slope[:, None]
    slower = max(1.0, float(np.max(np.abs(qd) / speed)), float(np.sqrt(np.max(np.abs(qdd) / acceleration))))
    return JointTrajectory(t=times * slower, q=np.clip(q, way.min(0), way.max(0)), qd=qd / slower, qdd=qdd / slower**2)


def _fastest(path: PchipInterpolator, grid: Array, qd_max: Array, qdd_max: Array) -> Array:
    """Square of ds/dt at every grid point, shape (K + 1,) [1/s^2]; zero at both ends."""
    # Here, because it takes a second to import, which who does not use it should not wait for.
    cp: Any = import_module("cvxpy")  # Any: half of what it exports is untyped

    cell = np.diff(grid)
    b = cp.Variable(len(grid))
    root = cp.Variable(len(grid))
    slope = cp.multiply(b[1:] - b[:-1], 0.5 / cell)
    rows = [b[0] == 0.0, b[-1] == 0.0, b >= 0.0, root <= cp.sqrt(b), root[1:-1] >= 0.0]
    rows.append(cp.multiply(np.max((path(grid, 1) / qd_max) ** 2, axis=1), b) <= 1.0)
    inside = cell * 1e-6  # the second derivative jumps at knots: each cell is asked on its own side
    for at, end in ((grid[:-1] + inside, b[:-1]), (grid[1:] - inside, b[1:])):
        first, second = path(at, 1) / qdd_max, path(at, 2) / qdd_max
        rows.extend(
            cp.abs(cp.multiply(a, slope) + cp.multiply(c, end)) <= 1.0 for a, c in zip(first.T, second.T, strict=True)
        )
    problem = cp.Problem(cp.Minimize(cp.sum(cp.multiply(2.0 * cell, cp.inv_pos(root[1:] + root[:-1])))), rows)
    # Its default of 1e-8 is at the edge of what the vanishing speed at both ends lets it have.
    problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-6, tol_gap_rel=1e-6, tol_feas=1e-7)
    if b.value is None or problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise RuntimeError(f"time-optimal path: expected a solution, the solver says {problem.status}")
    squared: Array = np.maximum(np.asarray(b.value, dtype=np.float64), 0.0)
    squared[[0, -1]] = 0.0
    return squared


def _sample(grid: Array, squared: Array, dt: float) -> tuple[Array, Array, Array, Array]:
    """Times, s, ds/dt and its rate of change, with constant acceleration of s in every cell."""
    speeds = np.sqrt(squared)
    ends = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1]))])
    times = np.append(np.arange(0.0, ends[-1], dt), ends[-1])
    cell = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(grid) - 2)
    slope = (np.diff(squared) / (2.0 * np.diff(grid)))[cell]
    since = times - ends[cell]
    rate = np.maximum(speeds[cell] + slope * since, 0.0)
    rate[[0, -1]] = 0.0  # from rest to rest, to the last bit
    s = np.clip(grid[cell] + speeds[cell] * since + 0.5 * slope * since**2, grid[cell], grid[cell + 1])
    return times, s, rate, slope
