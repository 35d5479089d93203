"""An arm's workspace, a path in it, and motions along the path: for any robot and any row of points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import polars as pl

from ..control import CubicStopAndGo, solve_points, time_optimal_path, time_optimal_stop_and_go
from ..robots import tool_positions
from .second_opinion import nearest_distances

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..control import InverseKinematics, JointTrajectory, PointPath
    from ..robots import Robot, Workspace

    Array = NDArray[np.float64]

#: A point counts as reachable where the arm gets this near [m].
REACHED: Final = 1e-6
# Period of the trajectories' samples [s].
_PERIOD: Final = 0.01


@dataclass(frozen=True)
class Motion:
    """One way to move along the solved points.

    Attributes
    ----------
    name : str
    joints : JointTrajectory
    tool : ndarray, shape (N, 3)
        Tool centre point [m].
    """

    name: str
    joints: JointTrajectory
    tool: Array


@dataclass(frozen=True)
class PathStudy:
    """One row of points, solved, certified and moved along.

    Attributes
    ----------
    solution : PointPath
    second_opinion : ndarray, shape (N,)
        Smallest distance that another method found, for targets farther than `REACHED` from the solution; NaN for
        the others, whose solution is its own proof [m].
    motions : tuple of Motion
        Cubic stop-and-go, time-optimal stop-and-go, time-optimal without stops.
    """

    solution: PointPath
    second_opinion: Array
    motions: tuple[Motion, ...]

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self.solution.targets)

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """Which targets the arm gets within `REACHED` of, shape (N,)."""
        within: NDArray[np.bool_] = self.solution.error <= REACHED
        return within

    @property
    def disagreement(self) -> float:
        """Largest difference between our distances and the second opinion's [m]; 0 where all is reachable."""
        return float(np.max(np.abs(self.second_opinion - self.solution.error)[~self.reachable], initial=0.0))

    def frame(self, robot: Robot) -> pl.DataFrame:
        """One row per point: target, joint positions, where the tool gets, errors [m, rad]."""
        given = self.solution
        columns = {f"target_{axis}": given.targets[:, i] for i, axis in enumerate("xyz")}
        columns |= {name: given.q[:, i] for i, name in enumerate(robot.joint_names)}
        columns |= {axis: given.position[:, i] for i, axis in enumerate("xyz")}
        columns |= {"error": given.error, "second_opinion": self.second_opinion}
        return pl.DataFrame(columns).with_columns(status=pl.Series([status.value for status in given.status]))


def study_path(ik: InverseKinematics, targets: ArrayLike, q0: ArrayLike, *, starts: int = 8) -> PathStudy:
    """Solve a row of positions, have those out of reach certified, and plan motions along the solutions.

    Parameters
    ----------
    ik : InverseKinematics
        In mode `position`.
    targets : array_like, shape (N, 3)
        [m].
    q0 : array_like, shape (nv,)
        Start for the first [rad or m].
    starts : int
        Of the second opinion, for each point out of reach.
    """
    robot = ik.robot
    solution = solve_points(ik, targets, q0)
    far = solution.error > REACHED
    second = np.full(len(far), np.nan)
    second[far] = nearest_distances(robot, solution.targets[far], starts=starts)
    limits = (robot.qd_max, robot.qdd_max)
    cubic = CubicStopAndGo.fastest(solution.q, *limits)
    moved = {
        "cubic, stop and go": cubic.at(np.append(np.arange(0.0, cubic.duration, _PERIOD), cubic.duration)),
        "time-optimal, stop and go": time_optimal_stop_and_go(solution.q, *limits, dt=_PERIOD),
        "time-optimal, no stops": time_optimal_path(solution.q, *limits, dt=_PERIOD),
    }
    motions = tuple(Motion(name, joints, tool_positions(robot, joints.q)) for name, joints in moved.items())
    return PathStudy(solution, second, motions)


def motion_frame(robot: Robot, motion: Motion) -> pl.DataFrame:
    """One row per sample: time, joint positions, velocities, accelerations, tool [SI]."""
    joints = motion.joints
    columns = {"t": joints.t}
    for prefix, values in (("", joints.q), ("qd_", joints.qd), ("qdd_", joints.qdd)):
        columns |= {prefix + name: values[:, i] for i, name in enumerate(robot.joint_names)}
    return pl.DataFrame(columns | {axis: motion.tool[:, i] for i, axis in enumerate("xyz")})


def workspace_frame(robot: Robot, workspace: Workspace) -> pl.DataFrame:
    """One row per cube that was hit: tool point, joint positions, whether on the boundary [SI]."""
    columns = {axis: workspace.points[:, i] for i, axis in enumerate("xyz")}
    columns |= {name: workspace.q[:, i] for i, name in enumerate(robot.joint_names)}
    return pl.DataFrame(columns).with_columns(boundary=pl.Series(workspace.on_boundary))
