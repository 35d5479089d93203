"""Making a hand-guiding controller by names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..baselines import Baseline, is_baseline
from ..codegen import compile_step
from ..formulations import DEFAULT_DT, Mode
from ..solvers import PluginError
from .guiding import GuidingController
from .step import make_step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..formulations import Formulation
    from ..robots import Robot
    from ..solvers import Solver
    from .guiding_settings import GuidingSettings
    from .loop import AnyStep


def make_guiding(
    robot: Robot,
    formulation: str | Formulation | Baseline,
    modes: Sequence[str | Mode],
    solver: str | Solver = "active-set",
    *,
    compiled: bool = False,
    dt: float = DEFAULT_DT,
    settings: GuidingSettings | None = None,
    **options: Any,
) -> GuidingController:
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
        As in `make_step`; of a compiled controller, one of those in C.
    compiled : bool
        Run the ticks in C (`compile_step`); not for a baseline.
    dt : float
        Control period [s].
    settings : GuidingSettings, optional
    **options
        Handed to the solver, where it is given by name and the ticks are not compiled.

    Returns
    -------
    GuidingController
        Call it with (q, wrench).

    Raises
    ------
    PluginError, ModeError, ValueError
        Naming what is not known, or does not go together.
    """
    parsed = [Mode.parse(mode) if isinstance(mode, str) else mode for mode in modes]
    steps: list[AnyStep]
    if compiled:
        if isinstance(formulation, Baseline) or (isinstance(formulation, str) and is_baseline(formulation)):
            raise PluginError(f"baseline {formulation}: expected compiled=False, a baseline has no C")
        if options or not isinstance(solver, str):
            raise PluginError(f"solver: expected one by name and without options in C, got {solver!r}, {options}")
        steps = [compile_step(robot, formulation, mode, solver=solver) for mode in parsed]
    else:
        steps = [make_step(robot, formulation, mode, solver, **options) for mode in parsed]
    return GuidingController(steps, settings, dt)
