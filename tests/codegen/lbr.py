"""The compiled steps of the LBR, a state and a command of it, and ticks that several limits hold back."""

import numpy as np
from numpy.typing import NDArray

from kinqp.codegen import CompiledStep
from tests.codegen.compiled import compiled, near
from tests.robots.arms import arm

Array = NDArray[np.float64]
Q = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
V = np.array([0.1, 0.0, -0.05])


def lbr(formulation: str = "cartesian-error") -> CompiledStep:
    return compiled("lbr_med14", formulation, "fix-orientation")


def capped(formulation: str, cap: int, *, feasible: bool) -> CompiledStep:
    return compiled("lbr_med14", formulation, "fix-orientation", feasible=feasible, max_iterations=cap)


def hard_ticks(count: int, seed: int = 0) -> list[tuple[Array, Array]]:
    """Fast commands close to limits, so that several rows hold back."""
    robot, rng = arm("lbr_med14"), np.random.default_rng(seed)
    return [(near(robot.q_min, robot.q_max, rng), 2.0 * rng.normal(size=3)) for _ in range(count)]
