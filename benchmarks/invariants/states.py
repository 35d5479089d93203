"""Random and adversarial states, each made of a seed and its own number alone, and what judges a command there."""

from __future__ import annotations

import functools
import importlib.metadata
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from ...robots import Robot, RobotError, load_robot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...formulations import Mode

    Array = NDArray[np.float64]

DT: Final = 1e-3
KINDS: Final = (
    "inside",
    "on limits",
    "a hair off limits",
    "beyond limits",
    "singular",
    "quarter turns",
    "near zero",
    "most on limits",
)
# 0: a hand at rest; 1e3: what no arm can follow, nor a hand mean [m/s, rad/s].
SPEEDS: Final = (0.0, 1e-6, 1e-2, 0.2, 2.0, 1e3)
# Marks the stream of the last accelerations, which leaves all that `draw` gives as it is.
_CHANGE: Final = 1
_OFFSETS: Final = (0.0, 1e-17, 1e-12, 1e-9, 1e-5, 1e-3, 1e-2, -1e-17, -1e-9, -1e-5, -1e-2)
# How often another start is tried, and how close to a singularity it has to come.
_SINGULAR_STARTS: Final = 8
_SINGULAR_STEPS: Final = 30
_SINGULAR: Final = 1e-9
_EXAMPLES: Final = {"panda": ("panda_description/urdf/panda.urdf", "panda_hand")}


@functools.cache
def arm(name: str) -> Robot:
    """Load a robot by name or path; `panda` is that of the optional package example-robot-data.

    Raises
    ------
    RobotError
        When there is no such robot, or the package isn't installed.
    """
    if name not in _EXAMPLES:
        return load_robot(name)
    path, tip = _EXAMPLES[name]
    try:
        files = importlib.metadata.files("example-robot-data") or ()
    except importlib.metadata.PackageNotFoundError:
        files = ()
    for file in files:
        if str(file).endswith(f"robots/{path}"):
            return load_robot(Path(str(file.locate())), tip=tip)
    raise RobotError(f"robot {name}: expected the package example-robot-data, which has its URDF; pip install it")


@dataclass(frozen=True)
class StateSet:
    """States and what a command there is judged by; N of each.

    Attributes
    ----------
    kinds : tuple of str
    q, qd_prev : ndarray, shape (N, nv)
        Positions [rad or m], and commands of the tick before [rad/s or m/s]: within their bounds or on them.
    qdd_prev : ndarray, shape (N, nv)
        Accelerations of the tick before: within `qdd_max`, on it, up to three times as much, as after a rate limit that
        yielded, or infinite, unknown [rad/s^2 or m/s^2].
    v : ndarray, shape (N, m_free)
        Hand [m/s, rad/s].
    J_free, J_fixed : ndarray, shapes (N, m_free, nv) and (N, m_fixed, nv)
        Rows of pinocchio's Jacobian, along the mode's axes.
    low, high : ndarray, shape (N, nv)
        Velocity bounds (`viable`) [rad/s or m/s].
    braking : ndarray, shape (N, nv)
        The fastest admissible braking [rad/s or m/s].
    """

    kinds: tuple[str, ...]
    q: Array
    qd_prev: Array
    qdd_prev: Array
    v: Array
    J_free: Array
    J_fixed: Array
    low: Array
    high: Array
    braking: Array

    def first(self, count: int) -> StateSet:
        """The first so many of them."""
        arrays = (getattr(self, field.name)[:count] for field in fields(self) if field.name != "kinds")
        return StateSet(self.kinds[:count], *arrays)


class States:
    """States of a robot in a mode, by number: number `i` is the same however many are drawn.

    Parameters
    ----------
    robot : Robot
    mode : Mode
    seed : int
    """

    def __init__(self, robot: Robot, mode: Mode, seed: int) -> None:
        self.robot: Final = robot
        self.mode: Final = mode
        self.seed: Final = seed
        self._low: Final = np.where(np.isfinite(robot.q_min), robot.q_min, -np.pi)
        self._high: Final = np.where(np.isfinite(robot.q_max), robot.q_max, np.pi)
        self._singular: Final = self._find_singular()

    def draw(self, index: int) -> tuple[str, Array, Array, Array]:
        """Give kind, q, v and the last command as parts of its bounds (in -1 ... 1) of state number `index`."""
        rng = np.random.default_rng((self.seed, index))
        nv, low, high = self.robot.nv, self._low, self._high
        kind = KINDS[index % len(KINDS)]
        q = rng.uniform(low, high)
        side = np.where(rng.random(nv) < 0.5, low, high)
        tiny = 10.0 ** -rng.uniform(1.0, 12.0)
        if kind == "on limits":
            joints = rng.choice(nv, size=2, replace=False)
            q[joints] = side[joints]
        elif kind == "a hair off limits":
            inwards = np.where(side == low, 1.0, -1.0)
            q = np.where(rng.random(nv) < 0.6, side + inwards * rng.choice(_OFFSETS, nv), q)
        elif kind == "beyond limits":
            q += 0.1 * rng.choice([-1.0, 1.0], nv) * (high - low)
        elif kind == "singular" and self._singular:
            q = self._singular[int(rng.integers(len(self._singular)))] + tiny * rng.normal(size=nv)
        elif kind == "quarter turns":
            quarter = 0.5 * np.pi * np.round(q / (0.5 * np.pi)) + tiny * rng.normal(size=nv)
            q = np.where(rng.random(nv) < 0.6, quarter, q)
        elif kind == "near zero":
            q *= tiny if rng.random() < 0.9 else 0.0
        elif kind == "most on limits":
            q = np.where(rng.random(nv) < 0.7, side, q)
        v = rng.normal(size=self.mode.m_free) * rng.choice(SPEEDS)
        share = rng.uniform(-1.0, 1.0, nv) * rng.choice([0.0, 0.01, 1.0, 1.0])
        return kind, q, v, share if rng.random() < 0.75 else np.sign(share)

    def draw_change(self, index: int) -> Array:
        """Give the last accelerations of state number `index` as parts of `qdd_max`, infinite where unknown."""
        rng = np.random.default_rng((self.seed, index, _CHANGE))
        nv, what = self.robot.nv, rng.random()
        share, side = rng.uniform(-1.0, 1.0, nv), rng.choice([-1.0, 1.0], nv)
        if what < 0.25:  # of all joints, now and then of some
            return np.where(rng.random(nv) < rng.choice([0.5, 1.0, 1.0, 1.0]), side * np.inf, share)
        if what < 0.5:
            return np.where(rng.random(nv) < 0.6, side, share)
        if what < 0.625:
            return np.where(rng.random(nv) < 0.3, 3.0 * side, 3.0 * share)
        return np.asarray(share * rng.choice([0.0, 0.01, 1.0, 1.0]))

    def take(self, count: int) -> StateSet:
        """Draw states 0 ... count-1, and work out what a command there is judged by."""
        drawn = [self.draw(index) for index in range(count)]
        q, v, share = (np.array([each[i] for each in drawn]) for i in (1, 2, 3))
        low, high = bounds(self.robot, q)
        qd_prev = np.where(share > 0.0, share * high, -share * low)
        rows = np.array([mode_rows(self.robot, self.mode, each) for each in q])
        return StateSet(
            tuple(each[0] for each in drawn),
            q,
            qd_prev,
            np.array([self.draw_change(index) for index in range(count)]) * self.robot.qdd_max,
            v,
            rows[:, list(self.mode.free_rows)],
            rows[:, list(self.mode.fixed_rows)],
            low,
            high,
            braking(self.robot, qd_prev, low, high),
        )

    def _find_singular(self) -> tuple[Array, ...]:
        """Singular states: of the guided rows within what is left to them, and of the locked rows themselves."""
        rng = np.random.default_rng((self.seed, len(str(self.mode))))
        found = []
        for start in range(_SINGULAR_STARTS):
            locked = bool(start % 2) and self.mode.m_fixed > 0
            q = rng.uniform(self._low, self._high)
            for _ in range(_SINGULAR_STEPS):
                sigma = self._smallest(q, locked=locked)
                if sigma < _SINGULAR:
                    found.append(q)
                    break
                step = 1e-7 * np.eye(self.robot.nv)
                slope = np.array([self._smallest(q + h, locked=locked) - sigma for h in step]) / 1e-7
                move = -sigma * slope / max(float(slope @ slope), 1e-12)
                q = np.clip(q + move * min(1.0, 0.5 / max(float(np.abs(move).max()), 1e-12)), self._low, self._high)
        return tuple(found)

    def _smallest(self, q: Array, *, locked: bool) -> float:
        rows = mode_rows(self.robot, self.mode, q)
        fixed, guided = rows[list(self.mode.fixed_rows)], rows[list(self.mode.free_rows)]
        if not locked and fixed.size:
            _, sigma, Vt = np.linalg.svd(fixed)
            basis = Vt[: int(np.sum(sigma > 1e-9 * sigma[0]))]
            guided = guided - guided @ basis.T @ basis
        return float(np.linalg.svd(fixed if locked else guided, compute_uv=False)[-1])


def mode_rows(robot: Robot, mode: Mode, q: Array) -> Array:
    """All six rows of pinocchio's Jacobian along the mode's axes, shape (6, nv)."""
    return np.asarray(mode.twist_map_at(robot.pose(q)) @ robot.jacobian(q))


def bounds(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Velocity bounds (`viable`) at many positions, shapes (N, nv): DESIGN's formula once more, in NumPy."""

    def most(distance: Array) -> Array:
        step = robot.qdd_max * DT
        delta = np.maximum(np.minimum(distance, 1e9), 0.0) / (step * DT)
        m = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * delta) - 1.0))
        theta = (delta - 0.5 * m * (m + 1.0)) / (m + 1.0)
        return np.asarray(np.minimum(step * (m + theta), robot.qd_max))

    return -most(q - robot.q_min), most(robot.q_max - q)


def braking(robot: Robot, qd_prev: Array, low: Array, high: Array) -> Array:
    """Slow all joints down by one factor, none harder than `qdd_max`, and keep to the bounds; shapes (N, nv)."""
    speed = np.abs(qd_prev)
    after = np.maximum(speed - robot.qdd_max * DT, 0.0)
    factor = np.max(np.divide(after, speed, out=np.zeros_like(speed), where=speed > 0.0), axis=1, keepdims=True)
    return np.asarray(np.clip(factor * qd_prev, low, high))
