"""Control: one cycle from any formulation and solver, paths, the closed loop, inverse kinematics, trajectories."""

from ..formulations import BOUND_TOLERANCE, FIXED_TOLERANCE
from .compiled_guiding import CompiledGuiding
from .export_guiding import export_guiding
from .guided_run import GuidedRun, Hand, simulate_guiding
from .guiding import GuidingController
from .guiding_result import GuidingPhase, GuidingResult
from .guiding_settings import GuidingSettings
from .hand import CHARACTERS, EXPERT, NOVICE, Character
from .ik_result import IkResult, IkStatus
from .inverse_kinematics import InverseKinematics, inverse_kinematics
from .loop import AnyStep, Command, Guide, Trajectory, simulate
from .make_guiding import make_guiding
from .operator import Operator
from .paths import Path, PathFollower, SemicirclePath
from .point_path import PointPath, solve_points
from .position_observer import PositionObserver
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
    "AnyStep",
    "Character",
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
    "Operator",
    "Path",
    "PathFollower",
    "PointPath",
    "PositionObserver",
    "Push",
    "SemicirclePath",
    "SpiralPath",
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
