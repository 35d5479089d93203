"""The declaration in cvxpy: its objective in numbers, and its answer, against the lowered QP."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Final

import cvxpy
import numpy as np

from ...solvers import Status
from ...solvers.solution import JUDGE_TOLERANCE
from .answers import COST_TOLERANCE, cost_of, inputs_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ...control import InterpretedStep
    from ...formulations.to_cvxpy import CvxpyProblem
    from ...solvers import QP
    from .answers import Answers
    from .states import StateSet
    from .tally import Row

    Array = NDArray[np.float64]

NUMBERS: Final = 1e-9
_ALLOWED: Final = max(COST_TOLERANCE, JUDGE_TOLERANCE)
_TOLERANCE: Final = 1e-10
_TOLERANCES: Final = dict.fromkeys(("tol_feas", "tol_gap_abs", "tol_gap_rel"), _TOLERANCE)


def judge_declared(
    row: Row,
    made: CvxpyProblem,
    step: InterpretedStep,
    states: StateSet,
    given: Mapping[str, ArrayLike],
    reference: Answers | None,
) -> None:
    """Check the cvxpy problem on all states; the cost against `reference`, where that solved the state."""
    numbers, answer, allowed = [], [], []
    refused = 0
    for i in range(len(states.q)):
        inputs = inputs_of(step.inputs, states, i, given)
        qp = step.evaluate(states.q[i], states.v[i], **inputs).qp
        made.set(q=states.q[i], v=states.v[i], **inputs)
        numbers.append(_difference(made, qp, np.random.default_rng((i, qp.n))))
        x = _solve(made)
        if x is None:
            refused += 1
            answer.append(0.0)
            allowed.append(_ALLOWED)
            continue
        missed, primal = _primal(qp, x)
        answer.append(primal)
        allowed.append(_ALLOWED)
        if reference is not None and reference.status[i] is Status.SOLVED:
            cost, scale = cost_of(qp, x)
            # Its terms' constants are left out of the QP, and are part of what the solver's gap is relative to.
            scale = max(scale, abs(float(made.problem.value)))
            answer[-1] = max(primal, abs(cost - reference.cost[i]) / scale)
            # Rows that are missed, if by what a solver may, are worth their multipliers.
            allowed[-1] = max(primal, _ALLOWED + missed * reference.price[i] / scale)
        if primal > _ALLOWED:
            allowed[-1] = _ALLOWED
    row.notes["declared problem not solved"] = refused
    row.check("cvxpy numbers", numbers, NUMBERS, states)
    row.check("cvxpy answer", answer, allowed, states)


def _difference(made: CvxpyProblem, qp: QP, rng: np.random.Generator) -> float:
    """Of the objective's change between two points, relative to its parts."""
    one, two = rng.normal(size=(2, qp.n))
    values = []
    for x in (one, two):
        _put(made, x)
        values.append(float(made.problem.objective.args[0].value))
    scale = 1.0 + abs(values[0]) + abs(values[1])
    return abs((values[0] - values[1]) - (qp.objective(one) - qp.objective(two))) / scale


def _put(made: CvxpyProblem, x: Array) -> None:
    for name, where in made.lowered.variables.items():
        made.variables[name].value = x[where]


def _solve(made: CvxpyProblem) -> Array | None:
    problem: Any = made.problem  # whose own annotations have gaps
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they repeat the status
        try:
            problem.solve(solver="CLARABEL", warm_start=False, **_TOLERANCES)
        except (cvxpy.error.SolverError, ArithmeticError, ValueError):
            return None
    if problem.status != cvxpy.OPTIMAL:
        return None
    return np.concatenate([made.variables[name].value for name in made.lowered.variables])


def _primal(qp: QP, x: Array) -> tuple[float, float]:
    """Largest violation of a row, and largest relative to the row's terms of those above the solver's tolerance.

    A joint that hardly takes part has a row of 1e-9, of which the tolerance, absolute as it is, may be any share.
    """
    value = qp.stacked @ x
    violation = np.maximum(np.maximum(value - qp.upper, qp.lower - value), 0.0)
    terms = np.maximum(np.abs(qp.stacked) @ (1.0 + np.abs(x)), 1e-300)
    relative = np.where(violation > _TOLERANCE, violation / terms, 0.0)
    return float(np.max(violation, initial=0.0)), float(np.max(relative, initial=0.0))
