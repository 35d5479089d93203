"""The interface that every backend implements."""

from __future__ import annotations

from abc import ABC, abstractmethod
from importlib.util import find_spec
from time import perf_counter_ns
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self, final

from .options import positive
from .qp import QP
from .solution import RawSolution, Solution, Status, judge

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


class BackendError(RuntimeError):
    """A backend could not do its work; ends as `Status.FAILED`."""


#: What may come out of a backend's numerics. TypeError and the like are not here: they are mistakes in a
#: backend's adapter and must be seen.
BACKEND_ERRORS = (BackendError, ArithmeticError, ValueError, RuntimeError)


class Solver(ABC):
    """A method that solves QPs, one after another.

    A backend is a final subclass that says what it can do in the class variables below, takes its options as
    keyword arguments of its constructor and implements three hooks. It keeps its set-up between calls, so one
    instance belongs to one thread. Copies and pickles hold the options alone: what comes back is a new solver made with
    them, without a set-up and without a memory of problems before.

    Parameters
    ----------
    tolerance
        Accuracy that the backend is asked for; each backend says what it applies it to.
    """

    #: Registered name, kebab-case.
    name: ClassVar[str]
    #: Modules that must be importable for this backend to work.
    requires: ClassVar[tuple[str, ...]] = ()
    #: Whether it starts from `QP.x_feasible` and cannot do without.
    needs_feasible_start: ClassVar[bool] = False
    #: Whether it solves problems whose H is only positive semi-definite.
    handles_semidefinite: ClassVar[bool] = False
    #: Whether it recognises problems without a solution.
    detects_infeasibility: ClassVar[bool] = False
    #: What the solver's own timer times, where it has one.
    own_timer: ClassVar[str] = "the solve"
    #: How it can start other than from nothing, "active-set" (the last one) or "solution" (the last one), and the
    #: options of its constructor that make it.
    starts: ClassVar[Mapping[str, Mapping[str, object]]] = MappingProxyType({})

    #: What the constructor was called with.
    _made_with: tuple[tuple[Any, ...], dict[str, Any]]

    def __new__(cls, *arguments: Any, **options: Any) -> Self:
        """Keep the options, of which `__reduce__` makes copies."""
        self = super().__new__(cls)
        self._made_with = arguments, options
        return self

    def __init__(self, *, tolerance: float) -> None:
        self.tolerance = positive("tolerance", tolerance)
        self._structure: tuple[int, int, int, bytes] | None = None

    @classmethod
    @final
    def missing(cls) -> tuple[str, ...]:
        """Top-level modules that this backend requires and that are not installed; imports nothing."""
        return tuple(module for module in cls.requires if find_spec(module) is None)

    @classmethod
    @final
    def available(cls) -> bool:
        """Whether everything this backend requires is installed."""
        return not cls.missing()

    @classmethod
    def _found_by(cls) -> tuple[Callable[..., type[Solver]], tuple[str, ...]] | None:
        """Return a function and its arguments that find this class, where its own name does not."""
        return None

    @final
    def __reduce__(self) -> tuple[Any, ...]:
        """Say how `pickle` and `copy` make another one: from the options, since native objects cannot be copied."""
        found = type(self)._found_by()
        return _remade, (type(self) if found is None else None, found, *self._made_with)

    @final
    def solve(self, qp: QP) -> Solution:
        """Solve a QP, reusing the last set-up where the structure is the same, and judge the answer.

        Failures of the backend do not raise: they come back as `Status.FAILED` with a message. After anything but
        `Status.SOLVED` the set-up is dropped, because some backends do not recover from bad data by an update.

        Raises
        ------
        TypeError
            When `qp` is something else.
        """
        if not isinstance(qp, QP):
            raise TypeError(f"qp: expected a QP, got {type(qp).__name__}; make one as QP(H=..., g=...)")
        start = ready = perf_counter_ns()
        structure = qp.structure
        updated = structure == self._structure
        try:
            if updated:
                self._update(qp)
            else:
                self._setup(qp)
            ready = perf_counter_ns()
            raw = self._solve(qp)
            done = perf_counter_ns()
            solution = judge(qp, raw, 1e-9 * (ready - start), 1e-9 * (done - ready), updated=updated)
        except BACKEND_ERRORS as error:
            done = perf_counter_ns()
            text = str(error) if isinstance(error, BackendError) else f"{type(error).__name__}: {error}"
            failure = RawSolution(claimed=Status.FAILED, message=text)
            solution = judge(qp, failure, 1e-9 * (ready - start), 1e-9 * (done - ready), updated=updated)
        self._structure = structure if solution.status is Status.SOLVED else None
        return solution

    @final
    def reset(self) -> None:
        """Forget the set-up, so that the next answer depends on the next problem alone."""
        self._structure = None

    @abstractmethod
    def _setup(self, qp: QP) -> None:
        """Prepare for problems with the structure of `qp`, and take over its data."""

    @abstractmethod
    def _update(self, qp: QP) -> None:
        """Take over the data of `qp`, whose structure is the one last set up."""

    @abstractmethod
    def _solve(self, qp: QP) -> RawSolution:
        """Solve the problem that was last set up or updated, which is `qp`."""


def _remade(
    cls: type[Solver] | None,
    found: tuple[Callable[..., type[Solver]], tuple[str, ...]] | None,
    arguments: tuple[Any, ...],
    options: dict[str, Any],
) -> Solver:
    """Make a solver from its class, or from what finds the class, and its options."""
    if cls is None:
        assert found is not None  # noqa: S101  # `__reduce__` gives one of the two
        function, names = found
        cls = function(*names)
    return cls(*arguments, **options)
