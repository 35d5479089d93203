"""The states that are timed, the same at every run."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np

from kinqp.benchmarks import get_scenario
from kinqp.control import make_step, simulate
from kinqp.robots import load_robot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinqp.robots import Robot

    Array = NDArray[np.float64]

ROBOT: Final = "lbr_med14"
MODE: Final = "fix-orientation"
COUNT: Final = 20_000
# A joint near its limit is at most this far from it [rad].
NEAR: Final = 0.05
# Speed of the hand, from a careful one to a fast one [m/s].
SPEEDS: Final = (0.02, 0.4)


@dataclass(frozen=True)
class States:
    """Ticks to time.

    Attributes
    ----------
    name : str
        As in the tables.
    q : ndarray, shape (N, nv)
        Joint positions [rad].
    v : ndarray, shape (N, m_free)
        Velocity that the hand asks for [m/s].
    """

    name: str
    q: Array
    v: Array


@cache
def arm() -> Robot:
    """Load the arm of the suite."""
    return load_robot(ROBOT)


def near_limits(count: int = COUNT) -> States:
    """Draw positions over the whole range with none to three joints within `NEAR` of a limit, the hand anywhere."""
    robot, rng = arm(), np.random.default_rng(0)
    q = rng.uniform(robot.q_min, robot.q_max, (count, robot.nv))
    for row in q:
        joints = rng.choice(robot.nv, rng.integers(0, 4), replace=False)
        upper = rng.random(joints.size) < 0.5
        inwards = rng.uniform(0.0, NEAR, joints.size)
        row[joints] = np.where(upper, robot.q_max[joints] - inwards, robot.q_min[joints] + inwards)
    return States("random", q, _hand(rng, count))


def degenerate(count: int = COUNT) -> States:
    """Draw positions with one to five joints exactly at a limit."""
    robot, rng = arm(), np.random.default_rng(1)
    q = rng.uniform(robot.q_min, robot.q_max, (count, robot.nv))
    for row in q:
        joints = rng.choice(robot.nv, rng.integers(1, 6), replace=False)
        row[joints] = np.where(rng.random(joints.size) < 0.5, robot.q_max[joints], robot.q_min[joints])
    return States("degenerate", q, _hand(rng, count))


def semicircle() -> States:
    """Run the thesis's semicircle in closed loop at 1 kHz, once, and keep its ticks."""
    scenario = get_scenario("semicircle")
    step = make_step(scenario.robot, "cartesian-error", scenario.mode)
    run = simulate(step, scenario.guide, scenario.q0, scenario.duration, dt=scenario.dt)
    return States("semicircle", np.ascontiguousarray(run.q), np.ascontiguousarray(run.v))


def _hand(rng: np.random.Generator, count: int) -> Array:
    v = rng.normal(size=(count, 3))
    v *= (rng.uniform(*SPEEDS, count) / np.linalg.norm(v, axis=1))[:, None]
    return v
