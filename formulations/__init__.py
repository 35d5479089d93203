"""Formulations: a hand-guided arm's motion declared once as a QP, and lowered to its numbers."""

from .acceleration_bounds import acceleration_bounds, braking
from .acceleration_task import DEFAULT_TIME_CONSTANT
from .base import Formulation, SafeStop
from .bounds import BOUNDS, thesis_bound, velocity_bounds, viable_bound
from .cartesian_error import CartesianError
from .cartesian_error_acceleration import CartesianErrorAcceleration
from .cuts import Cut
from .evaluator import Evaluator, Instance
from .inputs import InputError, check_input
from .inverse import factor_fixed_rows, robust_inverse
from .joint_space import DEFAULT_JOINT_WEIGHT, JointSpace
from .joint_space_acceleration import JointSpaceAcceleration
from .lowering import DATA, Lowered, RowNames, lower
from .minimum_acceleration_norm import MinimumAccelerationNorm
from .minimum_torque_norm import MinimumTorqueNorm
from .modes import MODE_NAMES, Mode, ModeError
from .program import DeclarationError, QuadraticProgram
from .registry import available_formulations, get_formulation
from .result import StepResult
from .spy import PlotError
from .tick import DEFAULT_DT, Input, Tick

__all__ = [
    "BOUNDS",
    "DATA",
    "DEFAULT_DT",
    "DEFAULT_JOINT_WEIGHT",
    "DEFAULT_TIME_CONSTANT",
    "MODE_NAMES",
    "CartesianError",
    "CartesianErrorAcceleration",
    "Cut",
    "DeclarationError",
    "Evaluator",
    "Formulation",
    "Input",
    "InputError",
    "Instance",
    "JointSpace",
    "JointSpaceAcceleration",
    "Lowered",
    "MinimumAccelerationNorm",
    "MinimumTorqueNorm",
    "Mode",
    "ModeError",
    "PlotError",
    "QuadraticProgram",
    "RowNames",
    "SafeStop",
    "StepResult",
    "Tick",
    "acceleration_bounds",
    "available_formulations",
    "braking",
    "check_input",
    "factor_fixed_rows",
    "get_formulation",
    "lower",
    "robust_inverse",
    "thesis_bound",
    "velocity_bounds",
    "viable_bound",
]
