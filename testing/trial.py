"""A formulation x solver at seeded states: what it took, and how long beside a reference timed in the same run."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..control import make_step
from ..robots import load_robot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..formulations import Formulation
    from ..solvers import Status

    Array = NDArray[np.float64]

# Joints near a limit are at most this far from it [rad]; speed of the hand [m/s, rad/s].
_NEAR: Final = 0.05
_SPEEDS: Final = (0.02, 0.4)
_REPEATS: Final = 5


@dataclass(frozen=True)
class Trial:
    """What a marked test asks about.

    Iterations depend on states and versions alone and are to be compared exactly. Times are the machine's: there is
    only their ratio to a reference, timed at the same states in turn.

    Parameters
    ----------
    formulation : str or Formulation
        A registered name, `module:Name`, or an instance.
    solver, robot, mode : str
    ticks, seed : int
        States: joints anywhere, none to three of them near a limit, the hand in any direction; the arm at rest before,
        for formulations that ask for the last command.

    Raises
    ------
    ValueError
        When there are no ticks.
    """

    formulation: str | Formulation
    solver: str = "active-set"
    robot: str = "lbr_med14"
    mode: str = "fix-orientation"
    ticks: int = 200
    seed: int = 0
    reference: str = field(default="cartesian-error", init=False)

    def __post_init__(self) -> None:
        if self.ticks < 1:
            raise ValueError(f"ticks: expected at least 1, got {self.ticks}")

    @cached_property
    def states(self) -> tuple[Array, Array]:
        """Joint positions (ticks, nv) [rad or m] and hands (ticks, m_free) [m/s, rad/s]."""
        robot, rng = load_robot(self.robot), np.random.default_rng(self.seed)
        low, high = (np.where(np.isfinite(x), x, y) for x, y in ((robot.q_min, -np.pi), (robot.q_max, np.pi)))
        q = rng.uniform(low, high, (self.ticks, robot.nv))
        near = rng.random(q.shape).argsort(axis=1) < rng.integers(0, 4, (self.ticks, 1))
        inwards = rng.uniform(0.0, _NEAR, q.shape)
        q = np.where(near, np.where(rng.random(q.shape) < 0.5, high - inwards, low + inwards), q)
        v = rng.normal(size=(self.ticks, self._step.mode.m_free))
        v *= rng.uniform(*_SPEEDS, (self.ticks, 1)) / np.linalg.norm(v, axis=1, keepdims=True)
        return q, v

    @cached_property
    def iterations(self) -> tuple[int, ...]:
        """Of each tick; empty where the solver tells none."""
        return tuple(int(result.iterations) for result in self._results if result.iterations is not None)

    @cached_property
    def statuses(self) -> tuple[Status, ...]:
        """Of each tick, as judged by residuals."""
        return tuple(result.status for result in self._results)

    @cached_property
    def time_ratio(self) -> float:
        """Median over the states of this one's time over that of the reference by `active-set`, both interpreted."""
        mine, other = self._step, make_step(load_robot(self.robot), self.reference, self.mode, solver="active-set")
        best = np.full((2, self.ticks), np.inf)
        for _ in range(_REPEATS):
            for tick, (q, v) in enumerate(zip(*self.states, strict=True)):
                for which, step in enumerate((mine, other)):
                    inputs = _at_rest(step)
                    start = perf_counter()
                    step(q, v, **inputs)
                    best[which, tick] = min(best[which, tick], perf_counter() - start)
        return float(np.median(best[0] / best[1]))

    @cached_property
    def _step(self) -> Any:
        return make_step(load_robot(self.robot), self.formulation, self.mode, solver=self.solver)

    @cached_property
    def _results(self) -> list[Any]:
        return [self._step(q, v, **_at_rest(self._step)) for q, v in zip(*self.states, strict=True)]


def _at_rest(step: Any) -> dict[str, Array]:
    return {"qd_prev": np.zeros(step.robot.nv)} if "qd_prev" in step.inputs else {}
