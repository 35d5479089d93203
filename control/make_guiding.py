"""Making a hand-guiding controller by names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..baselines import Baseline, is_baseline
from ..codegen.step import SOLVER
from ..formulations import DEFAULT_DT
from ..solvers import PluginError
from .checks import checked_modes
from .compiled_guiding import CompiledGuiding
from .guiding import GuidingController
from .step import make_step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..formulations import Formulation, Mode
    from ..robots import Robot
    from ..solvers import Solver
    from .guiding_settings import GuidingSettings


def make_guiding(
    robot: Robot,
    formulation: str | Formulation | Baseline,
    modes: Sequence[str | Mode],
    solver: str | Solver = SOLVER,
    *,
    compiled: bool = False,
    dt: float = DEFAULT_DT,
    settings: GuidingSettings | None = None,
    **options: Any,
) -> GuidingController | CompiledGuiding:
    """Make the hand-guiding controller of a formulation or a baseline on a robot, in the modes that it can engage.

    Parameters
    ----------
    robot : Robot
        From `load_robot`.
    formulation : str, Formulation or Baseline
        As in `make_step`; with constraints, as in "joint-space+elbow-hold".
    modes : sequence of str or Mode
        The first one is engaged at the beginning.
    solver : str or Solver
        As in `make_step`; a compiled controller has the active set.
    compiled : bool
        The whole controller in C, from the wrench to the command; not for a baseline.
    dt : float
        Control period [s].
    settings : GuidingSettings, optional
    **options
        Handed to the solver, where it is given by name and the ticks are not compiled.

    Returns
    -------
    GuidingController or CompiledGuiding
        Call it with (q, wrench).

    Raises
    ------
    PluginError, ModeError, ValueError
        Naming what is not known, or does not go together.
    """
    if compiled:
        if isinstance(formulation, Baseline) or (isinstance(formulation, str) and is_baseline(formulation)):
            raise PluginError(f"baseline {formulation}: expected compiled=False, a baseline has no C")
        if options or solver != SOLVER:
            raise PluginError(f"solver: expected {SOLVER} without options in C, got {solver!r}, {options}")
        return CompiledGuiding(robot, formulation, modes, settings, dt)
    steps = [make_step(robot, formulation, mode, solver, **options) for mode in checked_modes(modes)]
    return GuidingController(steps, settings, dt)
