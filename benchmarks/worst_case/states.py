"""What is searched over: states, hands, the tick before, limits as run-time inputs; drawn anew or near others."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from .changes import Changes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ...codegen import CompiledStep

    Array = NDArray[np.float64]
    Limits = Mapping[str, Array]

#: Speeds of the hand that are searched, by powers of ten [m/s, rad/s]: slower ones meet no limit, faster ones no hand.
SPEED_EXPONENTS: Final = (-3.0, 0.5)
# Shares of joints put near a limit, and of those beyond it.
_NEAR_LIMIT: Final = 0.5
_BEYOND: Final = 0.05
# What a joint without position limits is drawn from [rad].
_TURN: Final = np.pi


@dataclass(frozen=True)
class Batch:
    """States of one set of limits, N of them.

    Attributes
    ----------
    q, qd_prev, qdd_prev : ndarray, shape (N, nv)
        [rad or m, .../s, .../s^2]; `qd_prev` and `qdd_prev` count where the step takes them. Infinite in `qdd_prev`:
        unknown.
    v : ndarray, shape (N, m_free)
        [m/s, rad/s].
    limits : mapping of str to ndarray
        Run-time inputs in place of the robot's own limits.
    """

    q: Array
    v: Array
    qd_prev: Array
    qdd_prev: Array
    limits: Limits = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of states."""
        return len(self.q)

    def pick(self, index: int) -> Batch:
        """One of the states, as a batch."""
        one = slice(index, index + 1)
        return Batch(self.q[one], self.v[one], self.qd_prev[one], self.qdd_prev[one], self.limits)

    def repeated(self, copies: int) -> Batch:
        """The first state, over and over."""
        rows = (self.q, self.v, self.qd_prev, self.qdd_prev)
        q, v, qd_prev, qdd_prev = (np.repeat(x[:1], copies, axis=0) for x in rows)
        return Batch(q, v, qd_prev, qdd_prev, self.limits)

    def inputs(self, step: CompiledStep) -> dict[str, Any]:
        """What `CompiledStep.batch` takes beyond state and hand."""
        return {**self.limits, **self.memory(step)}

    def memory(self, step: CompiledStep) -> dict[str, Array]:
        """What the step takes of the tick before, a row for each state."""
        return {name: getattr(self, name) for name in ("qd_prev", "qdd_prev") if name in step.inputs}


class Draws:
    """Draws states for a step.

    Parameters
    ----------
    step : CompiledStep
    rng : numpy.random.Generator
    """

    def __init__(self, step: CompiledStep, rng: np.random.Generator) -> None:
        self._step: Final = step
        self._rng: Final = rng
        # A stream of its own: all else is drawn as if there were no last accelerations.
        self._changes: Final = Changes(step, rng.spawn(1)[0])

    def limits(self) -> Limits:
        """Draw limits: the robot's own, every other time; else tighter ones, down to a tenth, by joint."""
        rng, robot = self._rng, self._step.robot
        if rng.random() < 0.5:
            return {}
        drawn: dict[str, Array] = {}
        for name in ("qd_max", "qdd_max"):
            if name in self._step.inputs:
                drawn[name] = getattr(robot, name) * 10.0 ** rng.uniform(-1.0, 0.0, robot.nv)
        if {"q_min", "q_max"} <= set(self._step.inputs):
            width = np.where(np.isfinite(robot.q_max - robot.q_min), robot.q_max - robot.q_min, 0.0)
            low, high = rng.uniform(0.0, 0.4, (2, robot.nv)) * width
            drawn |= {"q_min": robot.q_min + low, "q_max": robot.q_max - high}
        return drawn

    def anywhere(self, count: int, limits: Limits) -> Batch:
        """Draw states of all kinds: joints anywhere, near their limits down to 1e-12, some beyond them.

        Where the step takes last accelerations, half of the ticks have ones, and commands, that keep the locked rows.
        """
        rng, nv = self._rng, self._step.robot.nv
        low, high = self._range(limits)
        q = rng.uniform(low, high, (count, nv))
        q = self._snapped(q, limits, rng.random((count, 1)) * _NEAR_LIMIT * 2.0)
        v, qd_prev = self._hands(count), self._commands(count, limits)
        qdd_prev = self._changes.anywhere(count, limits)
        qd_prev, qdd_prev = self._changes.consistent(q, qd_prev, qdd_prev, self._fastest(limits), limits)
        return Batch(q, v, qd_prev, qdd_prev, limits)

    def near(self, one: Batch, count: int) -> Batch:
        """Draw states around one: moved by shares of the range from a third down to 1e-6, single parts drawn anew."""
        rng, nv = self._rng, self._step.robot.nv
        low, high = self._range(one.limits)
        scale = 10.0 ** rng.uniform(-6.0, -0.5, (count, 1))
        moved = rng.random((count, nv)) < rng.uniform(0.1, 1.0, (count, 1))
        q = one.q + moved * scale * (high - low) * rng.normal(size=(count, nv))
        q = self._snapped(q, one.limits, np.where(rng.random((count, 1)) < 0.5, 0.2, 0.0))
        size = np.linalg.norm(one.v) + 1e-12
        v = one.v + scale * size * rng.normal(size=(count, one.v.shape[1]))
        v = np.where(
            rng.random((count, 1)) < 0.1, self._hands(count), v * 10.0 ** (scale * rng.normal(size=(count, 1)))
        )
        fastest = self._fastest(one.limits)
        qd_prev = np.clip(one.qd_prev + scale * fastest * rng.normal(size=(count, nv)), -fastest, fastest)
        qdd_prev = self._changes.near(one.qdd_prev, scale, one.limits)
        qd_prev, qdd_prev = self._changes.consistent(q, qd_prev, qdd_prev, fastest, one.limits)
        return Batch(q, v, qd_prev, qdd_prev, one.limits)

    def _range(self, limits: Limits) -> tuple[Array, Array]:
        robot = self._step.robot
        low, high = limits.get("q_min", robot.q_min), limits.get("q_max", robot.q_max)
        return np.where(np.isfinite(low), low, -_TURN), np.where(np.isfinite(high), high, _TURN)

    def _fastest(self, limits: Limits) -> Array:
        fastest = limits.get("qd_max", self._step.robot.qd_max)
        return np.where(np.isfinite(fastest), fastest, 1.0)

    def _snapped(self, q: Array, limits: Limits, share: Array) -> Array:
        """Put joints near a limit."""
        rng = self._rng
        low, high = self._range(limits)
        upper = rng.random(q.shape) < 0.5
        inwards = np.where(rng.random(q.shape) < _BEYOND, -1.0, 1.0) * 10.0 ** rng.uniform(-12.0, -1.0, q.shape)
        inwards = np.where(rng.random(q.shape) < 0.3, 0.0, inwards)  # exactly on it
        at = np.where(upper, high - inwards, low + inwards)
        snapped: Array = np.where(rng.random(q.shape) < share, at, q)
        return snapped

    def _hands(self, count: int) -> Array:
        direction = self._rng.normal(size=(count, self._step.mode.m_free))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        hands: Array = direction * 10.0 ** self._rng.uniform(*SPEED_EXPONENTS, (count, 1))
        return hands

    def _commands(self, count: int, limits: Limits) -> Array:
        fastest = self._fastest(limits)
        return self._rng.uniform(-fastest, fastest, (count, self._step.robot.nv))
