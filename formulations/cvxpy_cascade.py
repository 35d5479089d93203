"""A hierarchy as cvxpy problems, solved one after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from .hierarchy import ABOVE
from .inputs import InputError
from .to_cvxpy import CvxpyProblem

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ..robots import Robot
    from .hierarchy import Hierarchy
    from .modes import Mode

    Array = NDArray[np.float64]


class CvxpyCascade:
    """A hierarchy on a robot in a mode as one DPP problem for each level; `Formulation.to_cvxpy` makes one.

    What a level hands to the next, `qd_above`, is a Parameter of that one. Not to be shared between threads.

    Attributes
    ----------
    levels : tuple of CvxpyProblem
        The most important one first.
    """

    def __init__(self, formulation: Hierarchy, robot: Robot, mode: Mode) -> None:
        self.levels: Final = tuple(CvxpyProblem(level, robot, mode) for level in formulation.levels)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the run-time inputs that `solve` takes: those of all levels, but for what they hand on."""
        names = (name for level in self.levels for name in level.inputs)
        return tuple(name for name in dict.fromkeys(names) if name != ABOVE)

    def solve(self, solver: str, options: dict[str, Any] | None = None, **inputs: ArrayLike) -> Array:
        """Solve all levels in order at a state and give the last one's command, shape (nv,) [rad/s or m/s].

        Parameters
        ----------
        solver : str
            As ``cvxpy.Problem.solve`` wants it.
        options : dict, optional
            Handed to the solver of every level.
        **inputs : array_like
            `q` and `v` always, and any other of `inputs`.

        Raises
        ------
        InputError
            Naming an input that is unknown, missing, of the wrong size, not finite or out of its range.
        NotSolvedError
            When a level is not solved; the levels' problems say which, and hold its status.
        """
        known = self.inputs
        for name in inputs:
            if name not in known:
                raise InputError(f"{name}: expected an input among {', '.join(known)}, got {name!r}")
        above: dict[str, ArrayLike] = {}
        for level in self.levels:
            given = {name: value for name, value in (inputs | above).items() if name in level.inputs}
            level.set(**given)
            problem: Any = level.problem  # whose solve carries no types
            problem.solve(solver=solver, **(options or {}))
            command = level.command()
            above = {ABOVE: command}
        return command
