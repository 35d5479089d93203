"""The formulations in accelerations, their answers, and states as a tick of the velocity level leaves them."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinqp.control import make_step
from kinqp.formulations import DEFAULT_TIME_CONSTANT, Mode
from kinqp.solvers import get_solver
from tests.finite_differences import difference_jacobian
from tests.formulations.reference import DT, adversarial_state, evaluator, rows_at

if TYPE_CHECKING:
    from kinqp.control import InterpretedStep
    from kinqp.formulations import Instance
    from kinqp.robots import Robot
    from tests.formulations.reference import Array

NAMES = (
    "cartesian-error-acceleration",
    "joint-space-acceleration",
    "minimum-acceleration-norm",
    "minimum-torque-norm",
)
MODES = ("free", "position", "fix-orientation", "fix-position", "line:z", "plane:0,0,1", "rcm:0.1")
# In quick runs two modes stand for all.
SOME_MODES = [
    pytest.param(mode, marks=() if mode in ("fix-orientation", "free") else pytest.mark.long) for mode in MODES
]
ARMS = ("lbr_med14", "ur5e", "panda")
T = DEFAULT_TIME_CONSTANT
WIDE = {"qdd_max": 1e6}


def solved(instance: Instance) -> Array:
    solution = get_solver("active-set").solve(instance.qp)
    assert solution.solved, solution.message
    return solution.x


def command(instance: Instance) -> Array:
    return np.asarray(instance.K @ solved(instance) + instance.k)


def stretch(name: str, robot: str, mode: str, instance: Instance) -> float:
    return float(solved(instance)[evaluator(robot, name, mode).lowered.variables["stretch"]][0])


def admissible(robot: Robot, mode: str, count: int, seed: int = 0) -> list[tuple[Array, Array, Array]]:
    """Draw (q, qd_prev, v) as a tick of `joint-space` leaves them, half at limits; the hand may change its mind."""
    rng, step = np.random.default_rng(seed), velocity_step(robot, mode)
    states: list[tuple[Array, Array, Array]] = []
    while len(states) < count:
        q = adversarial_state(robot, rng) if len(states) % 2 else robot.random_configuration(rng)
        q = np.clip(q, robot.q_min, robot.q_max)
        v = rng.normal(size=Mode.parse(mode).m_free) * rng.choice([0.01, 0.1, 0.3])
        result = step(q, v)
        if result.status.value == "solved":
            states.append((q + DT * result.qd, result.qd, v + rng.choice([0.0, 0.01, 0.3]) * rng.normal(size=v.size)))
    return states


@functools.cache
def velocity_step(robot: Robot, mode: str) -> InterpretedStep:
    return make_step(robot, "joint-space", mode, "active-set")


def tool_speed(robot: Robot, mode: Mode, q: Array, qd: Array) -> tuple[Array, Array]:
    """Velocity of the guided rows in the tick before, and dJ/dt qd, from finite differences of pinocchio's Jacobian."""
    rate = difference_jacobian(lambda t: rows_at(robot, mode, q + t[0] * qd)[0] @ qd, np.zeros(1))[:, 0]
    return rows_at(robot, mode, q)[0] @ qd - DT * rate, rate
