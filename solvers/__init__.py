"""Quadratic programs, and the solvers for them behind one interface.

The canonical QP: minimise ``1/2 x'Hx + g'x`` subject to ``A x = b``, ``l <= C x <= u``, ``lb <= x <= ub``,
where an infinite bound is an absent side. Multipliers satisfy ``H x + g + A'y + C'z + z_box = 0``, and a
negative entry of z or z_box means that the lower side is active. Whatever a backend claims, its answer is
judged by residuals computed here.

Every solver that qpsolvers or cvxpy finds installed answers to ``qpsolvers:<name>`` and ``cvxpy:<NAME>``. A backend is
added with one file and one line in `registry`, or from outside with an entry point in the group ``kinqp.solvers``, or
unregistered as an instance, a class, or ``"module:Class"``.
"""

from .certificates import (
    FarkasCertificate,
    UnboundedRay,
    is_dual_infeasibility_certificate,
    is_primal_infeasibility_certificate,
)
from .options import OptionError, UnknownOptionError
from .plugins import PluginError
from .qp import QP
from .registry import available_solvers, get_solver, solve
from .residuals import Residuals, residuals
from .solution import JUDGE_TOLERANCE, RawSolution, Solution, Status
from .solver import BackendError, Solver
from .validation import QPError

__all__ = [
    "JUDGE_TOLERANCE",
    "QP",
    "BackendError",
    "FarkasCertificate",
    "OptionError",
    "PluginError",
    "QPError",
    "RawSolution",
    "Residuals",
    "Solution",
    "Solver",
    "Status",
    "UnboundedRay",
    "UnknownOptionError",
    "available_solvers",
    "get_solver",
    "is_dual_infeasibility_certificate",
    "is_primal_infeasibility_certificate",
    "residuals",
    "solve",
]
