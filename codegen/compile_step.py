"""Compiling a step by names: which formulation, which mode, which of the solvers that exist as C."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ..formulations import Hierarchy, Mode, get_formulation
from . import qrqp
from .step import SOLVER, CompiledStep

if TYPE_CHECKING:
    from ..formulations import Formulation
    from ..robots import Robot

SOLVERS: Final = (SOLVER, qrqp.NAME)


def compile_step(
    robot: Robot,
    formulation: str | Formulation,
    mode: str | Mode,
    solver: str = SOLVER,
    *,
    feasible: bool = False,
    max_iterations: int | None = None,
) -> CompiledStep:
    """Compile the control cycle of a formulation on a robot in a mode.

    The first time this takes some seconds of the system's C compiler; after that the library is found in a cache by its
    content.

    Parameters
    ----------
    robot : Robot
        From `load_robot`.
    formulation : str or Formulation
        A registered name, `module:Name`, or an instance.
    mode : str or Mode
        As in `Mode.parse`, or an instance.
    solver : {"active-set", "casadi-qrqp"}
        The solver in the C code: our own, or the one that CasADi generates, to compare with. That tells no iterations
        (-1) and takes neither `feasible` nor `max_iterations`.
    feasible, max_iterations
        See `CompiledStep`.

    Raises
    ------
    ValueError
        When the solver has no C counterpart.
    CompilerError
        When there is no C compiler, or it fails.
    """
    if solver not in SOLVERS:
        known = ", ".join(SOLVERS)
        raise ValueError(f"solver: expected one that is generated as C ({known}), got {solver!r}; see make_step")
    if solver == qrqp.NAME and (feasible or max_iterations is not None):
        raise ValueError(f"feasible, max_iterations: expected neither with {solver}, which doesn't take them")
    made = get_formulation(formulation)
    if solver == qrqp.NAME and isinstance(made, Hierarchy):
        raise ValueError(f"solver: expected {SOLVER} for {made.name}, which is several QPs in order, got {solver!r}")
    return CompiledStep(
        robot,
        made,
        Mode.parse(mode) if isinstance(mode, str) else mode,
        solver,
        feasible=feasible,
        max_iterations=max_iterations,
    )
