"""Control: one cycle from any formulation and solver, paths for the hand, the closed loop."""

from .loop import Guide, Step, Trajectory, simulate
from .paths import Path, PathFollower, SemicirclePath
from .step import BOUND_TOLERANCE, FIXED_TOLERANCE, InterpretedStep, make_step

__all__ = [
    "BOUND_TOLERANCE",
    "FIXED_TOLERANCE",
    "Guide",
    "InterpretedStep",
    "Path",
    "PathFollower",
    "SemicirclePath",
    "Step",
    "Trajectory",
    "make_step",
    "simulate",
]
