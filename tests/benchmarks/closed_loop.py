"""A scenario run with our compiled step, written apart from the sweep's own loop."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kinqp.benchmarks import get_scenario
from kinqp.codegen import compile_step
from kinqp.solvers import Status

if TYPE_CHECKING:
    from kinqp.benchmarks import Scenario


@dataclass(frozen=True)
class Run:
    """One entry per tick; `sigma_min` of the whole Jacobian, `error` of the locked rows that were sent."""

    scenario: Scenario
    q: np.ndarray
    qd: np.ndarray
    v: tuple[np.ndarray, ...]
    eps: tuple[np.ndarray, ...]
    phase: np.ndarray
    iterations: np.ndarray
    active: tuple[tuple[str, ...], ...]
    error: np.ndarray
    sigma_min: np.ndarray

    @property
    def distance(self) -> np.ndarray:
        """To the nearer limit, shape (N + 1, nv) [rad]."""
        robot = self.scenario.robot
        q = np.vstack([self.q, self.q[-1] + self.scenario.dt * self.qd[-1]])
        return np.minimum(robot.q_max - q, q - robot.q_min)


@functools.cache
def run(name: str, formulation: str = "cartesian-error") -> Run:
    scenario = get_scenario(name)
    robot, dt = scenario.robot, scenario.dt
    q, qd = np.array(scenario.q0), np.zeros(robot.nv)
    rows = []
    for index, phase in enumerate(scenario.phases):
        step = compile_step(robot, formulation, phase.mode)
        given = {name: value for name, value in scenario.inputs.items() if name in step.inputs}
        free, fixed = list(phase.mode.free_rows), list(phase.mode.fixed_rows)
        for tick in range(round(phase.duration / dt)):
            pose = robot.pose(q)
            twist_map, jacobian = phase.mode.twist_map_at(pose), robot.jacobian(q)
            v = (twist_map @ phase.guide.twist(tick * dt, pose))[free]
            remembered = {"qd_prev": qd} if "qd_prev" in step.inputs else {}
            result = step(q, v, dt=dt, **given, **remembered)
            assert result.status is Status.SOLVED, (name, index, tick)
            qd = result.qd
            error = np.max(np.abs((twist_map @ jacobian)[fixed] @ qd), initial=0.0)
            sigma = np.linalg.svd(jacobian, compute_uv=False)[-1]
            rows.append((q, qd, v, result.eps, index, result.iterations, result.active, error, sigma))
            q = q + dt * qd
    columns = list(zip(*rows, strict=True))
    arrays = [np.array(columns[k]) for k in (0, 1, 4, 5, 7, 8)]
    q_all, qd_all, phases, iterations, errors, sigmas = arrays
    return Run(scenario, q_all, qd_all, columns[2], columns[3], phases, iterations, columns[6], errors, sigmas)
