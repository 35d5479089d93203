"""Control: one cycle from any formulation and solver, paths, the closed loop, inverse kinematics, trajectories."""

from ..formulations import BOUND_TOLERANCE, FIXED_TOLERANCE
from .compiled_guiding import CompiledGuiding
from .export_guiding import export_guiding
from .guided_run import GuidedRun, Hand, simulate_guiding
from .guiding import GuidingController
from .guiding_result import GuidingPhase, GuidingResult
from .guiding_settings import GuidingSettings
from .ik_result import IkResult, IkStatus
from .inverse_kinematics import InverseKinematics, inverse_kinematics
from .loop import AnyStep, Command, Guide, Step, Trajectory, simulate
from .make_guiding import make_guiding
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
    "AnyStep",
    "Command",
    "CompiledGuiding",
    "CubicStopAndGo",
    "Guide",
    "GuidedRun",
    "GuidingController",
    "GuidingPhase",
    "GuidingResult",
    "GuidingSettings",
    "Hand",
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
    "export_guiding",
    "inverse_kinematics",
    "make_guiding",
    "make_step",
    "relax",
    "simulate",
    "simulate_guiding",
    "solve_points",
    "time_optimal_path",
    "time_optimal_stop_and_go",
]
