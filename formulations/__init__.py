"""Formulations: a hand-guided arm's motion declared once as a QP, and lowered to its numbers."""

from .algebra import factor_of_positive
from .base import Formulation
from .bounds import BOUNDS, thesis_bound, velocity_bounds, viable_bound
from .cartesian_error import CartesianError
from .damped import DEFAULT_DAMPING, Damped
from .evaluator import Evaluator, Instance
from .hierarchical import Hierarchical
from .hierarchy import ABOVE, Hierarchy, command_above, levels_of
from .inputs import InputError, check_input
from .inverse import factor_fixed_rows, robust_inverse
from .joint_space import DEFAULT_JOINT_WEIGHT, JointSpace
from .joint_space_weighted import JointSpaceWeighted, limit_gradient
from .lowering import DATA, Lowered, RowNames, lower
from .minimum_kinetic_energy import MinimumKineticEnergy
from .minimum_velocity_norm import MinimumVelocityNorm
from .modes import MODE_NAMES, Mode, ModeError
from .program import DeclarationError, QuadraticProgram
from .registry import available_formulations, get_formulation
from .result import StepResult
from .task_scaling import TaskScaling
from .tick import DEFAULT_DT, Input, Tick

__all__ = [
    "ABOVE",
    "BOUNDS",
    "DATA",
    "DEFAULT_DAMPING",
    "DEFAULT_DT",
    "DEFAULT_JOINT_WEIGHT",
    "MODE_NAMES",
    "CartesianError",
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
    "JointSpaceWeighted",
    "Lowered",
    "MinimumKineticEnergy",
    "MinimumVelocityNorm",
    "Mode",
    "ModeError",
    "QuadraticProgram",
    "RowNames",
    "StepResult",
    "TaskScaling",
    "Tick",
    "available_formulations",
    "check_input",
    "command_above",
    "factor_fixed_rows",
    "factor_of_positive",
    "get_formulation",
    "levels_of",
    "limit_gradient",
    "lower",
    "robust_inverse",
    "thesis_bound",
    "velocity_bounds",
    "viable_bound",
]
