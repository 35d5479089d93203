"""One control cycle, from state and hand velocity to a joint velocity command that can be sent."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any, Final, overload

import numpy as np

from ..baselines import Baseline, BaselineStep, get_baseline, is_baseline
from ..formulations import (
    ABOVE,
    CommandCheck,
    Evaluator,
    InputError,
    Mode,
    StepResult,
    get_formulation,
    levels_of,
    lower,
    one_by_one,
    unmet_limits,
)
from ..solvers import PluginError, Status, get_solver

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Formulation, Input, Instance
    from ..robots import Robot
    from ..solvers import Solution, Solver

    Array = NDArray[np.float64]


class InterpretedStep:
    """A formulation on a robot in a mode, solved by any solver, called once per control period.

    A command is sent only if the solver's answer holds: finite, within the bounds to `BOUND_TOLERANCE`, the locked
    rows exact to `FIXED_TOLERANCE` relative to the joint speed's share in them. Otherwise the command is the
    formulation's safe stop, and `status` says why: zero velocity, which no bound excludes, or the fastest admissible
    braking (`Formulation.safe_stop`). Of a hierarchy all levels are solved, in order; where one of them fails the
    command is the safe stop too.

    Not to be shared between threads.

    Attributes
    ----------
    solved : tuple of (Instance, Solution)
        What was solved in the last call, level by level: the evidence behind its result.
    """

    def __init__(self, robot: Robot, formulation: Formulation, mode: Mode, solver: Solver) -> None:
        self.robot: Final = robot
        self.mode: Final = mode
        self.formulation: Final = formulation
        self.solver: Final = solver
        self._levels: Final = tuple(Evaluator(lower(level, robot, mode)) for level in levels_of(formulation))
        names = [given.name for level in self._levels for given in level.inputs]
        # Between the levels of a hierarchy this one is handed on, not given.
        passed_on = ABOVE if len(self._levels) > 1 else None
        self._inputs: Final = tuple(dict.fromkeys(name for name in names if name != passed_on))
        self.solved: tuple[tuple[Instance, Solution], ...] = ()

    def with_solver(self, solver: Solver) -> InterpretedStep:
        """Give the same step with another solver, without lowering its formulation again; not for another thread."""
        made = copy(self)
        # Not an attribute that changes: the copy is new, and this is where it is made.
        made.__dict__.update(solver=solver, solved=())
        return made

    @property
    def specs(self) -> tuple[Input, ...]:
        """What a call takes: `q`, `v` and the run-time inputs, with their sizes, defaults and ranges."""
        return tuple(
            {
                given.name: given for level in self._levels for given in level.inputs if given.name in self._inputs
            }.values()
        )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the run-time inputs, beyond `q` and `v`, that a call takes by keyword."""
        return tuple(name for name in self._inputs if name not in ("q", "v"))

    def evaluate(self, q: ArrayLike, v: ArrayLike, **inputs: ArrayLike) -> Instance:
        """Give the numbers of the (first level's) QP at a state, without solving it; arguments as in a call."""
        return self._levels[0](**self._given(self._levels[0], {"q": q, "v": v, **inputs}))

    def __call__(self, q: ArrayLike, v: ArrayLike, **inputs: ArrayLike) -> StepResult:
        """Compute the command.

        Parameters
        ----------
        q : array_like, shape (nv,)
            Joint positions [rad or m].
        v : array_like, shape (m_free,)
            Velocity that the hand asks for, along the mode's axes [m/s, rad/s].
        **inputs : array_like
            Any of `inputs`: limits, weights, `dt`, `v_fixed`, ...; each for this call only.

        Raises
        ------
        InputError
            Naming the input that is unknown, missing, of the wrong shape, not finite or out of range.
        """
        given = {"q": q, "v": v, **inputs}
        solved: list[tuple[Instance, Solution]] = []
        active: dict[str, None] = {}  # in order, each once
        for level in self._levels:
            above = {ABOVE: _command(*solved[-1])} if solved else {}
            instance = level(**self._given(level, given), **above)
            solution = self.solver.solve(instance.qp)
            solved.append((instance, solution))
            if solution.status is not Status.SOLVED or not np.isfinite(_command(instance, solution)).all():
                break
            active |= dict.fromkeys(level.active_rows(instance.qp, solution))
        self.solved = tuple(solved)
        return self._judge(solved, tuple(active))

    def batch(self, Q: ArrayLike, V: ArrayLike, **inputs: ArrayLike) -> list[StepResult]:
        """Compute the commands of many states, one after the other.

        Parameters
        ----------
        Q : array_like, shape (N, nv)
            Joint positions [rad or m].
        V : array_like, shape (N, m_free)
            Velocities that the hand asks for [m/s, rad/s].
        **inputs : array_like
            As in a call, the same for all states.
        """
        return one_by_one(self, Q, V, inputs)

    def _given(self, level: Evaluator, inputs: dict[str, ArrayLike]) -> dict[str, ArrayLike]:
        """Those of the inputs that a level takes."""
        if len(self._levels) == 1:
            return inputs
        for name in inputs:
            if name not in self._inputs:
                raise InputError(f"{name}: expected an input among {', '.join(self._inputs)}, got {name!r}")
        taken = {given.name for given in level.inputs}
        return {name: value for name, value in inputs.items() if name in taken}

    def _judge(self, levels: list[tuple[Instance, Solution]], active: tuple[str, ...]) -> StepResult:
        instance, solution = levels[-1]
        status, message = solution.status, solution.message
        if status is not Status.SOLVED and len(self._levels) > 1:
            message = f"{self._levels[len(levels) - 1].lowered.formulation.name}: {message}"
        qd = _command(instance, solution)
        kept = CommandCheck.of(qd, instance.J_fixed, instance.v_fixed, instance.qd_lo, instance.qd_hi)
        made = self._levels[-1].lowered.formulation
        off = unmet_limits(qd, instance.limits, sampled=made.bounds == "viable", acceleration=made.limits_acceleration)
        off = off or kept.joint_bounds or kept.locked_rows
        if status is Status.SOLVED and off:
            status, message = Status.INACCURATE, off
        solved = status is Status.SOLVED
        command = qd if solved else instance.stop
        return StepResult(
            qd=command,
            eps=instance.J_free @ command - instance.v,
            status=status,
            iterations=_total(each.iterations for _, each in levels),
            active=active if solved else (),
            fixed_error=kept.fixed_error,
            bound_violation=kept.bound_violation,
            sigma_min=_smallest_singular_value(instance.J_bar),
            setup_time=sum(each.setup_time for _, each in levels),
            solve_time=sum(each.solve_time for _, each in levels),
            message=message,
        )


def _command(instance: Instance, solution: Solution) -> Array:
    command: Array = instance.K @ solution.x + instance.k
    return command


def _total(counts: Iterable[int | None]) -> int | None:
    """Sum of counts; None where one of them is not known."""
    known = list(counts)
    return None if None in known else sum(count for count in known if count is not None)


def _smallest_singular_value(matrix: Array) -> float:
    # The square root of the Gram matrix's eigenvalue would lose half the digits near a singularity.
    return float(np.linalg.svd(matrix, compute_uv=False)[-1])


@overload
def make_step(
    robot: Robot, formulation: Formulation, mode: str | Mode, solver: str | Solver = ..., **options: Any
) -> InterpretedStep: ...


@overload
def make_step(
    robot: Robot, formulation: Baseline, mode: str | Mode, solver: str | Solver = ..., **options: Any
) -> BaselineStep: ...


@overload
def make_step(
    robot: Robot, formulation: str, mode: str | Mode, solver: str | Solver = ..., **options: Any
) -> InterpretedStep | BaselineStep: ...


def make_step(
    robot: Robot,
    formulation: str | Formulation | Baseline,
    mode: str | Mode,
    solver: str | Solver = "active-set",
    **options: Any,
) -> InterpretedStep | BaselineStep:
    """Make the control cycle of a formulation on a robot in a mode, solved by any solver; or that of a baseline.

    Parameters
    ----------
    robot : Robot
        From `load_robot`.
    formulation : str, Formulation or Baseline
        A registered name, `module:Name`, or an instance; options in brackets, as in "cartesian-error(bounds=thesis)".
    mode : str or Mode
        As in `Mode.parse`, or an instance.
    solver : str or Solver
        A registered name, `module:Name`, or an instance. A baseline has none, whatever is given.
    **options
        Handed to the solver, where it is given by name.

    Returns
    -------
    InterpretedStep or BaselineStep
        Call it with (q, v).

    Raises
    ------
    PluginError
        When one of the names is not known, or options come with a baseline.
    """
    parsed = Mode.parse(mode) if isinstance(mode, str) else mode
    if isinstance(formulation, Baseline) or (isinstance(formulation, str) and is_baseline(formulation)):
        if options:
            raise PluginError(f"baseline {formulation}: expected no options of a solver, got {', '.join(options)}")
        return BaselineStep(robot, get_baseline(formulation), parsed)
    return InterpretedStep(robot, get_formulation(formulation), parsed, get_solver(solver, **options))
