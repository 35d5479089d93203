"""Control: one cycle from any formulation and solver, paths, the closed loop, inverse kinematics, trajectories."""

from ..formulations import BOUND_TOLERANCE, FIXED_TOLERANCE
from .ik_result import IkResult, IkStatus
from .inverse_kinematics import InverseKinematics, inverse_kinematics
from .loop import Guide, Step, Trajectory, simulate
from .paths import Path, PathFollower, SemicirclePath
from .point_path import PointPath, solve_points
from .posture import relax
from .spiral import SpiralPath
from .step import InterpretedStep, make_step
from .time_optimal_path import time_optimal_path
from .trajectories import CubicStopAndGo, JointTrajectory, time_optimal_stop_and_go

__all__ = [
    "BOUND_TOLERANCE",
    "FIXED_TOLERANCE",
    "CubicStopAndGo",
    "Guide",
    "IkResult",
    "IkStatus",
    "InterpretedStep",
    "InverseKinematics",
    "JointTrajectory",
    "Path",
    "PathFollower",
    "PointPath",
    "SemicirclePath",
    "SpiralPath",
    "Step",
    "Trajectory",
    "inverse_kinematics",
    "make_step",
    "relax",
    "simulate",
    "solve_points",
    "time_optimal_path",
    "time_optimal_stop_and_go",
]
