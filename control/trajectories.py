"""Joint trajectories through points: cubic stop-and-go, and the fastest that limits allow."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
import ruckig

from ..robots import finite_vector, real_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

# Shortest time for a move [s]: a point repeated is waited at, not divided by zero.
_SHORTEST: Final = 1e-6


@dataclass(frozen=True)
class JointTrajectory:
    """Samples of a joint motion.

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time [s].
    q, qd, qdd : ndarray, shape (N, nv)
        Joint position, velocity and acceleration [rad or m, .../s, .../s^2].
    """

    t: Array
    q: Array
    qd: Array
    qdd: Array


@dataclass(frozen=True)
class CubicStopAndGo:
    """Third-order polynomials from point to point, at rest at each (N. Adaloglou, table 4).

    Parameters
    ----------
    points : ndarray, shape (N, nv)
        Joint positions to stop at [rad or m].
    times : ndarray, shape (N,)
        When, increasing [s].
    """

    points: Array
    times: Array

    def __post_init__(self) -> None:
        points, times = (real_array(name, getattr(self, name)).copy() for name in ("points", "times"))
        if points.ndim != 2 or len(points) < 2 or not np.isfinite(points).all():
            raise ValueError(f"points: expected at least 2 rows of finite joint positions, got shape {points.shape}")
        if times.shape != (len(points),) or not np.isfinite(times).all() or not (np.diff(times) > 0.0).all():
            raise ValueError(f"times: expected {len(points)} increasing finite numbers, got {self.times}")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "times", times)

    @staticmethod
    def fastest(points: ArrayLike, qd_max: ArrayLike, qdd_max: ArrayLike) -> CubicStopAndGo:
        """Give each move the shortest time that a cubic can have under limits.

        Speed peaks at 3/2 of the distance over the time, acceleration at 6 times the distance over its square.

        Parameters
        ----------
        points : array_like, shape (N, nv)
            [rad or m].
        qd_max, qdd_max : array_like, shape (nv,)
            Limits [rad/s or m/s; rad/s^2 or m/s^2].
        """
        way = real_array("points", points)
        distance = np.abs(np.diff(way, axis=0))
        speed, acceleration = _limits(qd_max, qdd_max, way.shape[-1])
        needed = np.maximum(1.5 * distance / speed, np.sqrt(6.0 * distance / acceleration)).max(axis=1, initial=0.0)
        return CubicStopAndGo(way, np.concatenate([[0.0], np.cumsum(np.maximum(needed, _SHORTEST))]))

    @property
    def duration(self) -> float:
        """From the first point to the last [s]."""
        return float(self.times[-1] - self.times[0])

    def coefficients(self) -> Array:
        """Coefficients a_0 ... a_3 of every move in the time since it began, shape (N - 1, 4, nv)."""
        time = np.diff(self.times)[:, None]
        way = np.diff(self.points, axis=0)
        return np.stack([self.points[:-1], np.zeros_like(way), 3.0 * way / time**2, -2.0 * way / time**3], axis=1)

    def at(self, t: ArrayLike) -> JointTrajectory:
        """Sample the motion; before the first time and after the last it stands still.

        At every time of `times` the position is the point itself and the velocity zero, to the last bit.

        Parameters
        ----------
        t : array_like, shape (M,)
            [s].
        """
        asked = np.atleast_1d(real_array("t", t))
        if asked.ndim != 1 or not np.isfinite(asked).all():
            raise ValueError(f"t: expected a row of finite times, got {t!r}")
        clipped = np.clip(asked, self.times[0], self.times[-1])
        move = np.clip(np.searchsorted(self.times, clipped, side="right") - 1, 0, len(self.times) - 2)
        begin, time = self.times[move], np.diff(self.times)[move]
        share = ((clipped - begin) / time)[:, None]
        way = np.diff(self.points, axis=0)[move]
        # From the nearer end, so that both ends are met exactly.
        left = share * share * (3.0 - 2.0 * share)
        right = (1.0 - share) ** 2 * (1.0 + 2.0 * share)
        q = np.where(share < 0.5, self.points[move] + way * left, self.points[move + 1] - way * right)
        still = ((asked < self.times[0]) | (asked > self.times[-1]))[:, None]
        rate = way / time[:, None]
        return JointTrajectory(
            t=asked,
            q=q,
            qd=np.where(still, 0.0, 6.0 * rate * share * (1.0 - share)),
            qdd=np.where(still, 0.0, 6.0 * rate / time[:, None] * (1.0 - 2.0 * share)),
        )


def time_optimal_stop_and_go(
    points: ArrayLike, qd_max: ArrayLike, qdd_max: ArrayLike, *, dt: float = 1e-3
) -> JointTrajectory:
    """Stop at every point, and move between them as fast as limits on velocity and acceleration allow.

    Ruckig computes each move: bang-bang in acceleration, all joints in the time of the slowest one.

    Parameters
    ----------
    points : array_like, shape (N, nv)
        Joint positions [rad or m].
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
        When an input has the wrong shape or is out of range, or Ruckig finds no move.
    """
    way, speed, acceleration = checked_job(points, qd_max, qdd_max, dt)
    nv = way.shape[1]
    planner, moves = ruckig.Ruckig(nv), []
    for begin, end in pairwise(way):
        asked = ruckig.InputParameter(nv)
        asked.current_position, asked.target_position = begin.tolist(), end.tolist()
        asked.max_velocity, asked.max_acceleration = speed.tolist(), acceleration.tolist()
        asked.max_jerk = [np.inf] * nv
        # A straight line between the points, where that costs no time.
        asked.synchronization = ruckig.Synchronization.Phase
        move = ruckig.Trajectory(nv)
        outcome = planner.calculate(asked, move)
        if outcome not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise ValueError(f"points: expected a move from {begin} to {end}, Ruckig says {outcome}")
        moves.append(move)
    ends = np.cumsum([move.duration for move in moves])
    times = np.append(np.arange(0.0, ends[-1], dt), ends[-1])
    number = np.minimum(np.searchsorted(ends, times, side="right"), len(moves) - 1)
    begins = np.concatenate([[0.0], ends[:-1]])
    samples = [moves[i].at_time(float(t - begins[i]))[:3] for i, t in zip(number, times, strict=True)]
    q, qd, qdd = (np.array(column) for column in zip(*samples, strict=True))
    return JointTrajectory(t=times, q=q, qd=qd, qdd=qdd)


def checked_job(points: ArrayLike, qd_max: ArrayLike, qdd_max: ArrayLike, dt: float) -> tuple[Array, Array, Array]:
    """Return points and limits of a time-optimal motion, shapes (N, nv) and (nv,), or name what can't be used.

    Raises
    ------
    ValueError
        When an input has the wrong shape or is out of range.
    """
    way = real_array("points", points)
    if way.ndim != 2 or len(way) < 2 or not np.isfinite(way).all():
        raise ValueError(f"points: expected at least 2 rows of finite joint positions, got shape {way.shape}")
    if not 0.0 < dt < np.inf:
        raise ValueError(f"dt: expected a positive number of seconds, got {dt}")
    return way, *_limits(qd_max, qdd_max, way.shape[1])


def _limits(qd_max: ArrayLike, qdd_max: ArrayLike, nv: int) -> tuple[Array, Array]:
    limits = finite_vector("qd_max", qd_max, nv), finite_vector("qdd_max", qdd_max, nv)
    for name, limit in zip(("qd_max", "qdd_max"), limits, strict=True):
        if not (limit > 0.0).all():
            raise ValueError(f"{name}: expected positive limits, got {limit}")
    return limits
