"""Baselines: closed-form redundancy resolution to compare formulations with, behind the same interface."""

from .base import Baseline, Promise, Resolved
from .geometric_clamping import GeometricClamping
from .geometric_scaling import GeometricScaling
from .gradient_projection import GradientProjection
from .linear import RANK_TOLERANCE, Prioritised, prioritise
from .null_space_compensation import NullSpaceCompensation
from .progressive_clamping import ProgressiveClamping
from .registry import available_baselines, get_baseline, is_baseline
from .saturation import Level
from .saturation_null_space import SaturationNullSpace, saturate_tasks
from .situation import Situation
from .step import BaselineStep, NoSolver
from .task_augmentation import TaskAugmentation
from .task_priority import TaskPriority
from .weighted_least_norm import WeightedLeastNorm

__all__ = [
    "RANK_TOLERANCE",
    "Baseline",
    "BaselineStep",
    "GeometricClamping",
    "GeometricScaling",
    "GradientProjection",
    "Level",
    "NoSolver",
    "NullSpaceCompensation",
    "Prioritised",
    "ProgressiveClamping",
    "Promise",
    "Resolved",
    "SaturationNullSpace",
    "Situation",
    "TaskAugmentation",
    "TaskPriority",
    "WeightedLeastNorm",
    "available_baselines",
    "get_baseline",
    "is_baseline",
    "prioritise",
    "saturate_tasks",
]
