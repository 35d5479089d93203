"""The same step asked of Pink."""

from __future__ import annotations

import warnings
from time import perf_counter_ns
from typing import TYPE_CHECKING, Any, Final

import pink
import pinocchio as pin
import qpsolvers
from pink.tasks import FrameTask

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from kinqp.robots import Robot

    Array = NDArray[np.float64]

DT: Final = 1e-3


class PinkStep:
    """`pink.solve_ik` for a hand velocity at fixed orientation: a frame task whose target is one period ahead.

    Pink's default limits (position, velocity) are on; the orientation is a cost, as frame tasks are.

    Parameters
    ----------
    robot : Robot
    """

    def __init__(self, robot: Robot) -> None:
        self._robot: Final = robot
        self._data: Final = robot.model.createData()

    def prepare(self, q: Array, v: Array) -> tuple[Any, list[FrameTask]]:
        """Set configuration and task up; forward kinematics and Jacobians are computed here, outside what is timed."""
        configuration = pink.Configuration(self._robot.model, self._data, self._robot.to_pinocchio(q))
        task = FrameTask(self._robot.tip, position_cost=1.0, orientation_cost=1.0)
        target = configuration.get_transform_frame_to_world(self._robot.tip)
        task.set_target(pin.SE3(target.rotation, target.translation + DT * v))
        return configuration, [task]

    def time(self, q: Array, v: Array, solver: str) -> int:
        """Time of one `pink.solve_ik` [ns]."""
        configuration, tasks = self.prepare(q, v)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that dense matrices are converted for a sparse solver
            start = perf_counter_ns()
            pink.solve_ik(configuration, tasks, DT, solver=solver)
            return perf_counter_ns() - start


def pink_solvers() -> list[str]:
    """The solvers that Pink can use here, but for HiGHS, which is far slower and announces itself at every start."""
    return sorted(set(qpsolvers.available_solvers) - {"highs"})
