"""``cvxpy:<NAME>``: every QP solver that cvxpy finds installed, through a parametrised cvxpy problem."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Final, final

import numpy as np

from .certificates import FarkasCertificate
from .families import Family
from .one_sided import OneSided, require_numbers
from .options import UnknownOptionError, gap_tolerance, one_line, tried, unknown
from .qp import QP
from .solution import RawSolution, Status
from .solver import BackendError, Solver

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from .validation import Array

#: cvxpy's words.
_STATUSES: Final = {
    "optimal": Status.SOLVED,
    "optimal_inaccurate": Status.INACCURATE,
    "infeasible": Status.PRIMAL_INFEASIBLE,
    "infeasible_inaccurate": Status.INACCURATE,
    "unbounded": Status.DUAL_INFEASIBLE,
    "unbounded_inaccurate": Status.INACCURATE,
    "infeasible_or_unbounded": Status.FAILED,
    "user_limit": Status.MAX_ITERATIONS,
    "solver_error": Status.FAILED,
}

#: The options of each solver that the tolerance is applied to.
TOLERANCES: Final[Mapping[str, tuple[str, ...]]] = {
    "CLARABEL": ("tol_feas", "tol_infeas_abs", "tol_infeas_rel"),
    "CVXOPT": ("feastol", "abstol", "reltol"),
    "DAQP": ("primal_tol", "dual_tol"),
    "ECOS": ("feastol", "abstol", "reltol"),
    "HIGHS": ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
    "OSQP": ("eps_abs", "eps_rel", "eps_prim_inf", "eps_dual_inf"),
    "PIQP": (
        "eps_abs",
        "eps_rel",
        "eps_duality_gap_abs",
        "eps_duality_gap_rel",
        "eps_primal_inf",
        "eps_dual_inf",
    ),
    "PROXQP": ("eps_abs", "eps_rel"),
    "QPALM": ("eps_abs", "eps_rel"),
    "SCS": ("eps_abs", "eps_rel", "eps_infeas"),
}
_GAP_TOLERANCES: Final[Mapping[str, tuple[str, ...]]] = {"CLARABEL": ("tol_gap_abs", "tol_gap_rel")}

#: The smallest tolerance that a solver accepts.
_LEAST_TOLERANCE: Final[Mapping[str, float]] = {"HIGHS": 1e-10}

#: Those of cvxpy's solvers that do not solve QPs: they know linear cones only, or other classes of problems.
_NO_QP: Final = frozenset({"CBC", "DIFFCP", "GLOP", "GLPK", "GLPK_MI", "IPOPT", "PDLP", "SCIPY", "SDPA", "UNO"})

#: Those whose proofs of primal infeasibility cvxpy passes on; it has no place for proofs of unboundedness.
_PROVES: Final = frozenset({"CLARABEL", "OSQP", "SCS"})


class CvxpyBridge(Solver):
    """cvxpy's way to one of its solvers; `bridge` makes the class for each.

    At set-up a problem ``1/2 |R x|^2 + g'x, A x = b, G x <= h`` with parameters R, g, A, b, G and h is declared and
    compiled, once per structure; R'R = H by eigenvalues, so that H may be singular. It follows the rules of
    disciplined parametrised programming, so an update sets parameters and compiles nothing. Meant as an independent
    second opinion, not for speed: the solver itself starts anew at every solve, and what cvxpy does before and after it
    counts as `solve_time`.

    Claims of unboundedness come without a certificate, since cvxpy passes none on.

    Parameters
    ----------
    tolerance
        Applied to the solver's options of that kind, see `TOLERANCES`; without effect for solvers that are not in it.
    settings
        Further options of the solver, as cvxpy takes them; they override the above. They are tried at once, on a
        problem with one variable.
    """

    requires: ClassVar[tuple[str, ...]] = ("cvxpy",)
    handles_semidefinite: ClassVar[bool] = True
    own_timer: ClassVar[str] = "what cvxpy passes on of its time: set-up and solve, as far as it says"

    def __init__(self, *, tolerance: float = 1e-9, settings: Mapping[str, object] | None = None) -> None:
        super().__init__(tolerance=tolerance)
        self._member = self._bridged()
        given = dict(settings or {})
        accepted = max(self.tolerance, _LEAST_TOLERANCE.get(self._member, 0.0))
        self._options: dict[str, Any] = {
            **dict.fromkeys(TOLERANCES.get(self._member, ()), accepted),
            **dict.fromkeys(_GAP_TOLERANCES.get(self._member, ()), gap_tolerance(accepted)),
            **given,
        }
        if given:
            self._check(given)

    @classmethod
    @abstractmethod
    def _bridged(cls) -> str:
        """Return cvxpy's name of the solver."""

    @final
    def _check(self, settings: Mapping[str, object]) -> None:
        from cvxpy.reductions.solvers.defines import SOLVER_MAP_QP

        # Where cvxpy passes on some options and ignores the rest, it has a list.
        names = getattr(SOLVER_MAP_QP.get(self._member), "ALLOWED_SOLVER_OPTS", None)
        for name in settings:
            if names is not None and name not in names:
                raise UnknownOptionError(unknown(f"Setting of {self.name}", name, names))

        def attempt() -> None:
            self._setup(QP(H=[[1.0]], g=[-1.0], ub=[0.5]))
            self._run()

        tried(self.name, settings, attempt)

    @final
    def _setup(self, qp: QP) -> None:
        cvxpy = _cvxpy()
        self._rows = OneSided(qp, box=False)
        n, equal, unequal = qp.n, self._rows.equalities, self._rows.inequalities
        x = cvxpy.Variable(n)
        self._parameters = {"R": cvxpy.Parameter((n, n)), "g": cvxpy.Parameter(n)}
        cost = 0.5 * cvxpy.sum_squares(self._parameters["R"] @ x) + self._parameters["g"] @ x
        constraints = []
        if equal:
            self._parameters |= {"A": cvxpy.Parameter((equal, n)), "b": cvxpy.Parameter(equal)}
            constraints.append(self._parameters["A"] @ x == self._parameters["b"])
        if unequal:
            self._parameters |= {"G": cvxpy.Parameter((unequal, n)), "h": cvxpy.Parameter(unequal)}
            constraints.append(self._parameters["G"] @ x <= self._parameters["h"])
        self._x = x
        self._problem: Any = cvxpy.Problem(cvxpy.Minimize(cost), constraints)
        self._update(qp)
        # cvxpy compiles at the first use, and keeps the result.
        with self._library():
            self._problem.get_problem_data(self._member, enforce_dpp=True)

    @final
    def _update(self, qp: QP) -> None:
        require_numbers(qp)
        A, b, G, h = self._rows.rows(qp)
        data = {"R": _root(qp.H), "g": qp.g, "A": A, "b": b, "G": G, "h": h}
        for name, parameter in self._parameters.items():
            parameter.value = data[name]

    @final
    def _solve(self, qp: QP) -> RawSolution:
        self._run()
        word = self._problem.status
        claimed = _STATUSES.get(word, Status.FAILED)
        vectors = self._multipliers(qp)
        y, z, z_box = vectors or (None, None, None)
        proof = claimed is Status.PRIMAL_INFEASIBLE and self.detects_infeasibility
        stats = self._problem.solver_stats
        return RawSolution(
            claimed=claimed,
            x=self._x.value,
            y=y,
            z=z,
            z_box=z_box,
            iterations=None if stats is None or stats.num_iters is None else int(stats.num_iters),
            certificate=FarkasCertificate(*vectors) if vectors and proof else None,
            # A timer that reads zero was not started: PIQP behind cvxpy, which asks it for none.
            own_time=(stats.solve_time or None) if stats else None,
            message="" if claimed is Status.SOLVED else f"{self.name} reports {word}.",
        )

    def _run(self) -> None:
        with self._library():
            self._problem.solve(solver=self._member, enforce_dpp=True, warm_start=False, **self._options)

    @contextmanager
    def _library(self) -> Iterator[None]:
        """Silence cvxpy's warnings, which repeat the status, and turn its errors into ours."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                yield
            except Exception as error:  # what the solvers behind cvxpy raise has nothing in common
                raise BackendError(f"{self.name} raised {type(error).__name__}: {one_line(error)}") from error

    def _multipliers(self, qp: QP) -> tuple[Array, Array, Array] | None:
        """Return multipliers in our order and signs; None where some are missing."""
        values = [constraint.dual_value for constraint in self._problem.constraints]
        if any(value is None for value in values):
            return None
        y = values[0] if self._rows.equalities else ()
        z = values[-1] if self._rows.inequalities else ()
        return self._rows.multipliers(qp, y, z)


def _root(H: Array) -> Array:
    """Return R with R'R = H."""
    eigenvalues, vectors = np.linalg.eigh(H)
    root: Array = np.sqrt(np.maximum(eigenvalues, 0.0))[:, None] * vectors.T
    return root


@cache
def bridge(member: str) -> type[Solver]:
    """Make the class for one of cvxpy's solvers."""

    @final
    class Bridged(CvxpyBridge):
        __doc__ = CvxpyBridge.__doc__

        name: ClassVar[str] = f"cvxpy:{member}"
        detects_infeasibility: ClassVar[bool] = member in _PROVES

        @classmethod
        def _bridged(cls) -> str:
            return member

        @classmethod
        def _found_by(cls) -> tuple[Callable[..., type[Solver]], tuple[str, ...]]:
            return bridge, (member,)

    return Bridged


def _cvxpy() -> Any:
    """Import cvxpy, whose own annotations have gaps."""
    return import_module("cvxpy")


def _members() -> tuple[str, ...]:
    return tuple(name for name in _cvxpy().installed_solvers() if name not in _NO_QP)


FAMILY = Family("cvxpy", "cvxpy", _members, bridge)
