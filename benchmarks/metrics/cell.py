"""One row of the sweep's table: iterations, times, errors, limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .motion import ON_LIMIT
from .spread import Spread

if TYPE_CHECKING:
    import polars as pl

    from ..scenarios import Scenario


@dataclass(frozen=True)
class CellMetrics:
    """One row of the table.

    Attributes
    ----------
    ticks, repeats : int
        Size of the run, and how often it was timed.
    iterations : Spread
        Over ticks; the same in every repeat.
    time : Spread
        Update plus solve through Python [s], over ticks and repeats, the first tick (a full set-up) aside.
    setup : float
        Median over repeats of the first tick's set-up [s].
    fixed_error : float
        Largest error of a locked row [m/s, rad/s].
    bound_violation : float
        Largest excess over a joint velocity bound [rad/s or m/s].
    peak_acceleration : float
        Largest joint acceleration, as a share of the joint's limit, over all joints.
    watched_acceleration : float
        The same of the joint that the scenario is about.
    failed : float
        Share of ticks that ended in the safe stop.
    on_limit : float
        Share of ticks with the watched joint within `ON_LIMIT` of a limit.
    closest : float
        Smallest distance of the watched joint to a limit [rad or m]; negative: beyond it.
    task_error : float
        Mean norm of the Cartesian error [m/s, rad/s].
    """

    ticks: int
    repeats: int
    iterations: Spread
    time: Spread
    setup: float
    fixed_error: float
    bound_violation: float
    peak_acceleration: float
    watched_acceleration: float
    failed: float
    on_limit: float
    closest: float
    task_error: float


def cell_metrics(frame: pl.DataFrame, scenario: Scenario) -> CellMetrics:
    """Sum up a cell's ticks.

    Parameters
    ----------
    frame : pl.DataFrame
        As `Store.read` gives it.
    scenario : Scenario
        What was run.
    """
    robot, joint = scenario.robot, scenario.watched_joints[0]
    q, qd = frame["q"].to_numpy(), frame["qd"].to_numpy()
    setup, solve = frame["setup_time"].to_numpy(), frame["solve_time"].to_numpy()
    acceleration = np.abs(np.diff(qd, axis=0, prepend=0.0)) / scenario.dt / robot.qdd_max
    q_end = q[-1] + scenario.dt * qd[-1]
    angle = np.append(q[:, joint], q_end[joint])
    distance = np.minimum(robot.q_max[joint] - angle, angle - robot.q_min[joint])
    return CellMetrics(
        ticks=len(frame),
        repeats=setup.shape[1],
        iterations=Spread.of(frame["iterations"].to_numpy().astype(float)),
        time=Spread.of((setup + solve)[1:]),
        setup=float(np.median(setup[0])),
        fixed_error=float(frame["fixed_error"].to_numpy().max()),
        bound_violation=float(frame["bound_violation"].to_numpy().max()),
        peak_acceleration=float(acceleration.max()),
        watched_acceleration=float(acceleration[:, joint].max()),
        failed=float(np.mean(frame["status"].to_numpy() != "solved")),
        on_limit=float(np.mean(distance <= ON_LIMIT)),
        closest=float(distance.min()),
        task_error=float(np.linalg.norm(frame["eps"].to_numpy(), axis=1).mean()),
    )
