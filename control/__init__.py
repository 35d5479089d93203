"""Control: one cycle from any formulation and solver, paths, the closed loop, inverse kinematics, trajectories."""

from ..formulations import BOUND_TOLERANCE, FIXED_TOLERANCE
from .hand import CHARACTERS, EXPERT, NOVICE, Character
from .ik_result import IkResult, IkStatus
from .inverse_kinematics import InverseKinematics, inverse_kinematics
from .loop import Guide, Step, Trajectory, simulate
from .operator import Operator, PathOperator
from .paths import Path, PathFollower, SemicirclePath
from .point_path import PointPath, solve_points
from .posture import relax
from .push import Push
from .spiral import SpiralPath
from .step import InterpretedStep, make_step
from .time_optimal_path import time_optimal_path
from .trajectories import CubicStopAndGo, JointTrajectory, time_optimal_stop_and_go

__all__ = [
    "BOUND_TOLERANCE",
    "CHARACTERS",
    "EXPERT",
    "FIXED_TOLERANCE",
    "NOVICE",
    "Character",
    "CubicStopAndGo",
    "Guide",
    "IkResult",
    "IkStatus",
    "InterpretedStep",
    "InverseKinematics",
    "JointTrajectory",
    "Operator",
    "Path",
    "PathFollower",
    "PathOperator",
    "PointPath",
    "Push",
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
