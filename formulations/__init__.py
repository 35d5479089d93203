"""Formulations: a hand-guided arm's motion declared once as a QP, and lowered to its numbers."""

from .base import Formulation
from .bounds import BOUNDS, thesis_bound, velocity_bounds, viable_bound
from .cartesian_error import CartesianError
from .evaluator import Evaluator, Instance
from .inputs import InputError, check_input
from .inverse import factor_fixed_rows, robust_inverse
from .joint_space import DEFAULT_JOINT_WEIGHT, JointSpace
from .lowering import DATA, Lowered, RowNames, lower
from .modes import MODE_NAMES, Mode, ModeError
from .program import DeclarationError, QuadraticProgram
from .registry import available_formulations, get_formulation, with_constraints
from .result import StepResult
from .tick import DEFAULT_DT, Input, Tick

__all__ = [
    "BOUNDS",
    "DATA",
    "DEFAULT_DT",
    "DEFAULT_JOINT_WEIGHT",
    "MODE_NAMES",
    "CartesianError",
    "DeclarationError",
    "Evaluator",
    "Formulation",
    "Input",
    "InputError",
    "Instance",
    "JointSpace",
    "Lowered",
    "Mode",
    "ModeError",
    "QuadraticProgram",
    "RowNames",
    "StepResult",
    "Tick",
    "available_formulations",
    "check_input",
    "factor_fixed_rows",
    "get_formulation",
    "lower",
    "robust_inverse",
    "thesis_bound",
    "velocity_bounds",
    "viable_bound",
    "with_constraints",
]
