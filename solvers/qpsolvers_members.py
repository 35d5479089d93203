"""What is known of the solvers behind qpsolvers: their options, their words, and what they pass on."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

from .clarabel import STATUSES as CLARABEL_STATUSES
from .piqp import STATUSES as PIQP_STATUSES
from .solution import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """What is known of one solver; one that is not in the table below is used with the defaults written here.

    Parameters
    ----------
    tolerances, gap_tolerances
        Its options that the tolerance and `gap_tolerance` are applied to.
    least_tolerance
        The smallest value that it accepts for them.
    settings
        Its options that are set otherwise than by default.
    names
        Lists the names of its settings, for solvers where qpsolvers ignores a wrong one.
    sparse, box
        Whether it wants sparse matrices, and whether it takes a box apart from the rows.
    semidefinite, proves
        Whether it solves problems with a singular H, and whether what it returns with a claim of infeasibility is
        a proof of it.
    word, statuses
        Its verdict in the extras of qpsolvers' solution, and what that means; all else is a failure.
    not_found
        What it means that nothing was found, where there is no word and no remark.
    iterations, own_time
        Its count and its own time, set-up and solve [s], in those extras.
    initial
        Whether qpsolvers hands it a point to start from.
    """

    tolerances: tuple[str, ...] = ()
    gap_tolerances: tuple[str, ...] = ()
    least_tolerance: float = 0.0
    settings: Mapping[str, object] = field(default_factory=dict)
    names: Callable[[], Iterable[str]] | None = None
    sparse: bool = False
    box: bool = True
    semidefinite: bool = False
    proves: bool = False
    word: Callable[[Mapping[str, Any]], str] | None = None
    statuses: Mapping[str, Status] = field(default_factory=dict)
    not_found: Status = Status.FAILED
    iterations: Callable[[Mapping[str, Any]], int] | None = None
    own_time: Callable[[Mapping[str, Any]], float] | None = None
    initial: bool = False


def _names_of(module: str, settings: str) -> Callable[[], Iterable[str]]:
    """List the attributes of a solver's class of settings."""

    def names() -> Iterable[str]:
        return (name for name in dir(getattr(import_module(module), settings)) if not name.startswith("_"))

    return names


def _info_iterations(extras: Mapping[str, Any]) -> int:
    return int(extras["info"].iter)


MEMBERS: Mapping[str, Member] = {
    "clarabel": Member(
        tolerances=("tol_feas", "tol_infeas_abs", "tol_infeas_rel"),
        gap_tolerances=("tol_gap_abs", "tol_gap_rel"),
        sparse=True,
        box=False,
        semidefinite=True,
        proves=True,
        word=lambda extras: str(extras["status"]),
        statuses=CLARABEL_STATUSES,
        own_time=lambda extras: float(extras["solve_time"]),
    ),
    "daqp": Member(tolerances=("primal_tol", "dual_tol")),
    "ecos": Member(tolerances=("feastol", "abstol", "reltol"), sparse=True, box=False),
    "highs": Member(
        tolerances=("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
        least_tolerance=1e-10,
        # On some QPs of robots it runs in circles without end; a second is a thousand times what others take.
        settings={"time_limit": 1.0},
        names=_names_of("highspy", "HighsOptions"),
        sparse=True,
        semidefinite=True,
    ),
    "osqp": Member(
        tolerances=("eps_abs", "eps_rel", "eps_prim_inf", "eps_dual_inf"),
        sparse=True,
        semidefinite=True,
        proves=True,
        word=lambda extras: str(extras["info"].status),
        statuses={
            "solved": Status.SOLVED,
            "solved inaccurate": Status.INACCURATE,
            "primal infeasible": Status.PRIMAL_INFEASIBLE,
            "primal infeasible inaccurate": Status.INACCURATE,
            "dual infeasible": Status.DUAL_INFEASIBLE,
            "dual infeasible inaccurate": Status.INACCURATE,
            "maximum iterations reached": Status.MAX_ITERATIONS,
            "run time limit reached": Status.MAX_ITERATIONS,
        },
        iterations=_info_iterations,
        own_time=lambda extras: float(extras["info"].run_time),
        initial=True,
    ),
    "piqp": Member(
        tolerances=(
            "eps_abs",
            "eps_rel",
            "eps_duality_gap_abs",
            "eps_duality_gap_rel",
            "eps_primal_inf",
            "eps_dual_inf",
        ),
        names=lambda: ("backend", *_names_of("piqp", "Settings")()),
        semidefinite=True,
        proves=True,
        word=lambda extras: str(extras["info"].status.name),
        statuses=PIQP_STATUSES,
        iterations=_info_iterations,
    ),
    "proxqp": Member(
        tolerances=("eps_abs", "eps_rel"),
        semidefinite=True,
        word=lambda extras: str(extras["info"].status.name),
        statuses={
            "PROXQP_SOLVED": Status.SOLVED,
            "PROXQP_MAX_ITER_REACHED": Status.MAX_ITERATIONS,
            "PROXQP_PRIMAL_INFEASIBLE": Status.PRIMAL_INFEASIBLE,
            "PROXQP_DUAL_INFEASIBLE": Status.DUAL_INFEASIBLE,
            "PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE": Status.INACCURATE,
        },
        iterations=_info_iterations,
        initial=True,
    ),
    "qpalm": Member(tolerances=("eps_abs", "eps_rel"), sparse=True),
    # Exact, hence without a tolerance. That it finds nothing is its word for contradictory constraints; all else is
    # an exception.
    "quadprog": Member(
        box=False,
        not_found=Status.PRIMAL_INFEASIBLE,
        iterations=lambda extras: int(extras["iterations"][0]),
    ),
    "scs": Member(
        tolerances=("eps_abs", "eps_rel", "eps_infeas"),
        sparse=True,
        semidefinite=True,
        proves=True,
        word=lambda extras: str(extras["status_val"]),
        # -6 and -7: infeasible and unbounded at best, when it stopped at its limit of iterations.
        statuses={
            "1": Status.SOLVED,
            "2": Status.MAX_ITERATIONS,
            "-1": Status.DUAL_INFEASIBLE,
            "-2": Status.PRIMAL_INFEASIBLE,
            "-6": Status.MAX_ITERATIONS,
            "-7": Status.MAX_ITERATIONS,
        },
        iterations=lambda extras: int(extras["iter"]),
        # SCS counts milliseconds.
        own_time=lambda extras: 1e-3 * float(extras["setup_time"] + extras["solve_time"]),
        initial=True,
    ),
}
