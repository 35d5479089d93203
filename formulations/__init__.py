"""Formulations: a hand-guided arm's motion declared once as a QP, and lowered to its numbers."""

from .acceleration_bounds import acceleration_bounds, braking
from .acceleration_task import DEFAULT_TIME_CONSTANT
from .algebra import factor_of_positive
from .base import Formulation, SafeStop
from .bounds import BOUNDS, thesis_bound, velocity_bounds, viable_bound
from .cartesian_error import CartesianError
from .cartesian_error_acceleration import CartesianErrorAcceleration
from .cartesian_error_robust import CartesianErrorRobust
from .command_check import BOUND_TOLERANCE, FIXED_TOLERANCE, CommandCheck, Limits, unmet_limits
from .cuts import Cut
from .damped import DEFAULT_DAMPING, Damped
from .evaluator import Evaluator, Instance
from .hierarchical import Hierarchical
from .hierarchy import ABOVE, Hierarchy, command_above, levels_of
from .inputs import InputError, check_input
from .inverse import factor_fixed_rows, robust_inverse
from .joint_space import DEFAULT_JOINT_WEIGHT, JointSpace
from .joint_space_acceleration import JointSpaceAcceleration
from .joint_space_robust import JointSpaceRobust
from .joint_space_weighted import JointSpaceWeighted, limit_gradient
from .lowering import DATA, Lowered, RowNames, lower
from .minimum_acceleration_norm import MinimumAccelerationNorm
from .minimum_kinetic_energy import MinimumKineticEnergy
from .minimum_torque_norm import MinimumTorqueNorm
from .minimum_velocity_norm import MinimumVelocityNorm
from .modes import MODE_NAMES, Mode, ModeError
from .program import DeclarationError, QuadraticProgram
from .registry import available_formulations, get_formulation, with_constraints
from .result import StepResult, one_by_one
from .spy import PlotError
from .task_scaling import TaskScaling
from .tick import Tick
from .tick_inputs import DEFAULT_DT, LONGEST_DT, SHORTEST_DT, Input

__all__ = [
    "ABOVE",
    "BOUNDS",
    "BOUND_TOLERANCE",
    "DATA",
    "DEFAULT_DAMPING",
    "DEFAULT_DT",
    "DEFAULT_JOINT_WEIGHT",
    "DEFAULT_TIME_CONSTANT",
    "FIXED_TOLERANCE",
    "LONGEST_DT",
    "MODE_NAMES",
    "SHORTEST_DT",
    "CartesianError",
    "CartesianErrorAcceleration",
    "CartesianErrorRobust",
    "CommandCheck",
    "Cut",
    "Damped",
    "DeclarationError",
    "Evaluator",
    "Formulation",
    "Hierarchical",
    "Hierarchy",
    "Input",
    "InputError",
    "Instance",
    "JointSpace",
    "JointSpaceAcceleration",
    "JointSpaceRobust",
    "JointSpaceWeighted",
    "Limits",
    "Lowered",
    "MinimumAccelerationNorm",
    "MinimumKineticEnergy",
    "MinimumTorqueNorm",
    "MinimumVelocityNorm",
    "Mode",
    "ModeError",
    "PlotError",
    "QuadraticProgram",
    "RowNames",
    "SafeStop",
    "StepResult",
    "TaskScaling",
    "Tick",
    "acceleration_bounds",
    "available_formulations",
    "braking",
    "check_input",
    "command_above",
    "factor_fixed_rows",
    "factor_of_positive",
    "get_formulation",
    "levels_of",
    "limit_gradient",
    "lower",
    "one_by_one",
    "robust_inverse",
    "thesis_bound",
    "unmet_limits",
    "velocity_bounds",
    "viable_bound",
    "with_constraints",
]
