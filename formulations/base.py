"""What a formulation is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from .bounds import BOUNDS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import cvxpy
    from numpy.typing import ArrayLike

    from ..robots import Robot
    from .cvxpy_cascade import CvxpyCascade
    from .modes import Mode
    from .program import QuadraticProgram
    from .tick import Tick
    from .to_cvxpy import CvxpyProblem

SafeStop = Literal["zero", "braking"]


@dataclass(frozen=True)
class Formulation(ABC):
    """A way to turn the hand's velocity into joint velocities, declared once as a QP.

    A subclass is a frozen dataclass: it gives `name` and `declare`, and its fields are its options. Numbers that a
    controller may want to change while it runs are not options but ``tick.parameter``.

    Parameters
    ----------
    bounds : {"viable", "thesis"}
        How joint velocity bounds follow from the limits; see `kinqp.formulations.velocity_bounds`.

    Notes
    -----
    Where a tick is not solved the safe stop is sent. A step that is told the last command, `qd_prev`, brakes from it as
    fast as the acceleration limits allow and no faster (`kinqp.formulations.braking`); one that is not can only send
    zero velocity at once. `safe_stop = "braking"` makes `qd_prev` an input of every step, also of a formulation that
    has no other use for it.

    `limits_acceleration` says that a solved command is within `qdd_max` of the last one at every tick: it is then
    checked like the other limits. A formulation whose acceleration limits may yield does not promise that.
    """

    bounds: str = "viable"

    name: ClassVar[str]
    safe_stop: ClassVar[SafeStop] = "zero"
    limits_acceleration: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.bounds not in BOUNDS:
            raise ValueError(f"bounds: expected one of {', '.join(BOUNDS)}, got {self.bounds!r}")

    @abstractmethod
    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle.

        Parameters
        ----------
        qp : QuadraticProgram
            Takes variables, weighted residuals, rows and the command.
        tick : Tick
            Gives the symbols of the control cycle.
        """

    # cvxpy takes a second to import, which who does not use it should not wait for.

    @staticmethod
    def from_cvxpy(
        problem: cvxpy.Problem,
        *,
        command: cvxpy.Expression,
        name: str,
        feasible: Mapping[str, cvxpy.Expression | ArrayLike] | None = None,
        bounds: str = "viable",
    ) -> Formulation:
        """Make a formulation of a problem written in cvxpy.

        Its Parameters carry the names of what they stand for: a quantity of `Tick` (`J_free`, `qd_hi`, `M`, ...), whose
        shape they have, or else a run-time input of the formulation, whose default is the value that they have now.
        Labels of constraints become the names of rows. ``docs/cvxpy.md`` shows one.

        Parameters
        ----------
        problem : cvxpy.Problem
            A QP that follows the rules of disciplined parametrised programming (DPP).
        command : cvxpy.Expression, shape (nv,)
            What the robot is sent, affine in the problem's variables [rad/s or m/s].
        name : str
            In kebab-case.
        feasible : mapping of str to cvxpy.Expression or numbers, optional
            A point that satisfies all rows whatever the state, as `QuadraticProgram.feasible` wants it: values of all
            variables, by name, in Parameters and numbers.
        bounds : {"viable", "thesis"}
            As of every formulation.

        Raises
        ------
        DeclarationError
            When the problem is not DPP or not a QP, or the command is no expression of its variables; and, once robot
            and mode are known, when a Parameter has another shape than the quantity whose name it carries.

        Notes
        -----
        The map from parameters to QP data is that of cvxpy's canonicalisation. Auxiliary variables that it adds for
        sums of squares are put in again, so that the QP has the variables that the problem was written in.
        """
        from .from_cvxpy import from_cvxpy

        return from_cvxpy(problem, command, name, feasible or {}, bounds)

    def to_cvxpy(self, robot: Robot, mode: str | Mode) -> CvxpyProblem | CvxpyCascade:
        """Give the problem as a DPP problem of cvxpy with named Parameters, for a robot in a mode.

        Of a hierarchy there is one for each level, and a `solve` that takes them in order.

        Raises
        ------
        DeclarationError
            As of `lower`.
        """
        from .cvxpy_cascade import CvxpyCascade
        from .hierarchy import Hierarchy
        from .to_cvxpy import CvxpyProblem

        if isinstance(self, Hierarchy):
            return CvxpyCascade(self, robot, _mode(mode))
        return CvxpyProblem(self, robot, _mode(mode))

    def describe(self, robot: Robot, mode: str | Mode) -> str:
        """Write the problem as Markdown: in LaTeX, with its dimensions, named rows and run-time inputs.

        Of a hierarchy, all levels in order.

        Raises
        ------
        DeclarationError
            As of `lower`.
        """
        from .describe import describe

        return describe(self, robot, _mode(mode))

    def spy(self, robot: Robot, mode: str | Mode, path: str | Path) -> Path:
        """Draw which entries of the problem's KKT matrix are constant and which change from tick to tick.

        Parameters
        ----------
        robot : Robot
        mode : str or Mode
        path : str or Path
            File to write, ending in .png or .svg.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        PlotError
            When the file name ends otherwise.
        """
        from .spy import spy

        return spy(self, robot, _mode(mode), path)


def _mode(mode: str | Mode) -> Mode:
    from .modes import Mode

    return Mode.parse(mode) if isinstance(mode, str) else mode
