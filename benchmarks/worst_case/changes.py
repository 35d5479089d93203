"""Last accelerations that are searched over; and last commands that go with them, as those of an arm in motion do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ...codegen import CompiledStep

    Array = NDArray[np.float64]
    Limits = Mapping[str, Array]

# Shares of ticks whose last accelerations are unknown, of all joints or of some; of those on what the arm may do, in
# some joints; and of those beyond, up to so many times as much, as after a rate limit that yielded. The rest is within.
_UNKNOWN: Final = 0.2
_PARTLY_UNKNOWN: Final = 0.05
_HARDEST: Final = 0.25
_TOO_HARD: Final = 0.1
_OVERSHOOT: Final = 3.0
# Share of ticks whose last command and accelerations keep the locked rows.
_CONSISTENT: Final = 0.5
# Singular values of the locked rows below this share of the largest are none.
_RANK: Final = 1e-9


class Changes:
    """Draws last accelerations: infinite, unknown, throughout where the step doesn't take them.

    Parameters
    ----------
    step : CompiledStep
    rng : numpy.random.Generator
    """

    def __init__(self, step: CompiledStep, rng: np.random.Generator) -> None:
        self._step: Final = step
        self._rng: Final = rng
        self._taken: Final = "qdd_prev" in step.inputs

    def anywhere(self, count: int, limits: Limits) -> Array:
        """Draw them unknown, of all joints or of some; on `qdd_max`, within it down to none at all, and beyond."""
        rng, shape = self._rng, (count, self._step.robot.nv)
        if not self._taken:
            return np.full(shape, np.inf)
        what = rng.random((count, 1))
        share, side = rng.uniform(-1.0, 1.0, shape), rng.choice([-1.0, 1.0], shape)
        unknown = side * np.inf
        kinds = (
            (_UNKNOWN, unknown),
            (_PARTLY_UNKNOWN, np.where(rng.random(shape) < 0.5, unknown, share)),
            (_HARDEST, np.where(rng.random(shape) < 0.6, side, share)),
            (_TOO_HARD, _OVERSHOOT * np.where(rng.random(shape) < 0.3, side, share)),
        )
        within = share * rng.choice([0.0, 0.01, 1.0, 1.0], (count, 1))
        below = np.cumsum([part for part, _ in kinds])
        drawn = np.select([what < most for most in below], [values for _, values in kinds], within)
        return np.asarray(drawn * self._hardest(limits))

    def near(self, one: Array, scale: Array, limits: Limits) -> Array:
        """Move one tick's, shape (1, nv), by shares of `qdd_max`; put some on it, draw some ticks anew.

        Parameters
        ----------
        one : ndarray, shape (1, nv)
            What is unknown stays so, unless it is put on `qdd_max` or drawn anew.
        scale : ndarray, shape (N, 1)
            The shares.
        limits : mapping of str to ndarray
        """
        rng, shape = self._rng, (len(scale), self._step.robot.nv)
        fresh = self.anywhere(len(scale), limits)
        if not self._taken:
            return fresh
        hardest = self._hardest(limits)
        moved = one + scale * hardest * rng.normal(size=shape)
        moved = np.where(np.isinf(moved), moved, np.clip(moved, -_OVERSHOOT * hardest, _OVERSHOOT * hardest))
        on_it = rng.random(shape) < np.where(rng.random((len(scale), 1)) < 0.5, 0.2, 0.0)
        moved = np.where(on_it, rng.choice([-1.0, 1.0], shape) * hardest, moved)
        return np.where(rng.random((len(scale), 1)) < 0.1, fresh, moved)

    def consistent(
        self, q: Array, qd_prev: Array, qdd_prev: Array, fastest: Array, limits: Limits
    ) -> tuple[Array, Array]:
        """Take from half of the last commands and accelerations what moves the locked rows.

        An arm in motion keeps them in every tick. Where the last tick doesn't lead to keeping them, the robust
        formulations widen the window of the jerk limit by what it takes, and at commands drawn at random that is so
        much that hardly a tick depends on the last accelerations. Both keep their largest shares of `fastest` and
        `qdd_max`.

        Parameters
        ----------
        q, qd_prev, qdd_prev : ndarray, shape (N, nv)
        fastest : ndarray, shape (nv,)
            [rad/s or m/s].
        limits : mapping of str to ndarray

        Returns
        -------
        qd_prev, qdd_prev : ndarray, shape (N, nv)
        """
        mode, robot = self._step.mode, self._step.robot
        if not (self._taken and mode.m_fixed):
            return qd_prev, qdd_prev
        chosen = np.flatnonzero(self._rng.random(len(q)) < _CONSISTENT)
        if not chosen.size:
            return qd_prev, qdd_prev
        rows = np.array([mode.twist_map_at(robot.pose(q[i])) @ robot.jacobian(q[i]) for i in chosen])
        J_fixed = rows[:, list(mode.fixed_rows)]
        onto = np.linalg.pinv(J_fixed, rcond=_RANK) @ J_fixed
        unknown = np.isinf(qdd_prev[chosen])
        qdd = _kept(onto, np.where(unknown, 0.0, qdd_prev[chosen]), self._hardest(limits))
        qd_prev, qdd_prev = qd_prev.copy(), qdd_prev.copy()
        qd_prev[chosen] = _kept(onto, qd_prev[chosen], fastest)
        qdd_prev[chosen] = np.where(unknown, qdd_prev[chosen], qdd)
        return qd_prev, qdd_prev

    def _hardest(self, limits: Limits) -> Array:
        hardest = limits.get("qdd_max", self._step.robot.qdd_max)
        return np.where(np.isfinite(hardest), hardest, 1.0)


def _kept(onto: Array, x: Array, most: Array) -> Array:
    """Take away the part along the locked rows, and stretch back to the largest share of `most` that there was."""
    free = x - (onto @ x[:, :, None])[:, :, 0]
    before, after = (np.max(np.abs(each) / most, axis=1, keepdims=True) for each in (x, free))
    stretched = free * np.divide(before, after, out=np.zeros_like(after), where=after > _RANK * before)
    kept: Array = np.clip(stretched, -before * most, before * most)
    return kept
