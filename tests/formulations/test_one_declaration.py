"""One declaration: the lowered numbers, cvxpy's, and the generated C agree to 1e-9, whatever is registered."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from kinqp.control import make_step
from kinqp.formulations import Evaluator, get_formulation
from kinqp.solvers import Status
from tests.codegen.compiled import compiled
from tests.formulations.inputs import inputs_at, varied
from tests.formulations.reference import MODES, ONE_QP
from tests.robots.arms import arm

if TYPE_CHECKING:
    from kinqp.formulations.to_cvxpy import CvxpyProblem
    from kinqp.solvers import QP
    from tests.formulations.reference import Array

ARMS = ("lbr_med14", "ur5e", "panda")
TOLERANCE = 1e-9
ALL = [(name, robot, mode) for name in ONE_QP for robot in ARMS for mode in MODES]
# Per formulation each mode once, on the three arms in turn; the others in the long run.
SOME = [(name, ARMS[(i + j) % 3], mode) for i, name in enumerate(ONE_QP) for j, mode in enumerate(MODES)]
FEW = [(name, ARMS[i % 3], MODES[(2 + 3 * i) % 7]) for i, name in enumerate(ONE_QP)]


def cases(quick: list[tuple[str, str, str]]) -> list[Any]:
    return [*quick, *(pytest.param(*case, marks=pytest.mark.long) for case in ALL if case not in quick)]


@cache
def both(formulation: str, robot: str, mode: str) -> tuple[CvxpyProblem, Evaluator]:
    made = get_formulation(formulation).to_cvxpy(arm(robot), mode)
    return made, Evaluator(made.lowered)


@pytest.mark.parametrize(("formulation", "robot", "mode"), cases(SOME))
def test_cvxpy_has_the_numbers_of_the_lowering(formulation: str, robot: str, mode: str) -> None:
    made, numbers = both(formulation, robot, mode)
    rng = np.random.default_rng(0)
    for _ in range(3):
        inputs = varied(made.lowered, arm(robot).random_configuration(rng), rng)
        made.set(**inputs)
        qp = numbers(**inputs).qp
        one, two = rng.normal(size=(2, qp.n))
        difference = objective(made, one) - objective(made, two)
        scale = 1.0 + abs(objective(made, one)) + abs(objective(made, two))
        assert difference == pytest.approx(qp.objective(one) - qp.objective(two), abs=TOLERANCE * scale)
        put(made, one)
        for name, constraints in made.constraints.items():
            ours = slacks(made, qp, one, name)
            theirs = [cvxpy_slack(made, constraint, one) for constraint in constraints]
            assert len(ours) == len(theirs)
            for mine, other in zip(ours, theirs, strict=True):
                np.testing.assert_allclose(other, mine, rtol=TOLERANCE, atol=TOLERANCE * (1.0 + np.abs(mine).max()))


def put(made: CvxpyProblem, x: Array) -> None:
    for name, where in made.lowered.variables.items():
        made.variables[name].value = x[where]


def objective(made: CvxpyProblem, x: Array) -> float:
    put(made, x)
    return float(made.problem.objective.args[0].value)


def slacks(made: CvxpyProblem, qp: QP, x: Array, name: str) -> list[Array]:
    """Room that the lowered rows of a name leave, in the order of their indices: lower sides, upper sides.

    Of equalities, what they are off by, up to its sign. Rows that the lowering scaled are known up to a factor.
    """
    rows = made.lowered.rows
    off = [abs(qp.A[i] @ x - qp.b[i]) for i, label in enumerate(rows.equalities) if belongs(label, name)]
    if off:
        return [np.array(off)]
    found: dict[int, tuple[float, float]] = {}
    for i, label in enumerate(rows.inequalities):
        if belongs(label, name):
            found[index(label)] = (qp.C[i] @ x - qp.l[i], qp.u[i] - qp.C[i] @ x)
    for j, label in enumerate(rows.box):
        if belongs(label, name):
            room = (x[j] - qp.lb[j], qp.ub[j] - x[j])
            found[index(label)] = room[::-1] if label.startswith("-") else room
    sides = np.array([found[i] for i in sorted(found)]).T
    return [side[np.isfinite(side)] for side in sides if np.isfinite(side).any()]


def belongs(label: str, name: str) -> bool:
    return label.lstrip("-").rpartition("[")[0] == name


def index(label: str) -> int:
    return int(label.rpartition("[")[2].rstrip("]"))


def cvxpy_slack(made: CvxpyProblem, constraint: Any, x: Array) -> Array:
    """Room that a constraint leaves, rows of a single entry per unit of that entry, as the lowering has them."""
    equality = "Equality" in type(constraint).__name__
    put(made, x)
    value = np.asarray(constraint.expr.value)
    if equality:
        return np.abs(value)
    slopes = np.zeros((value.size, x.size))
    for j in range(x.size):
        step = np.zeros(x.size)
        step[j] = 1.0
        put(made, x + step)
        slopes[:, j] = np.asarray(constraint.expr.value) - value
    put(made, x)
    single = in_the_box(made, constraint)
    factor = np.where(single, np.abs(slopes).max(axis=1), 1.0)
    kept = np.abs(value) < 1e19  # sides that an input makes infinite
    return np.asarray((-value / factor)[kept])


def in_the_box(made: CvxpyProblem, constraint: Any) -> Array:
    name = constraint.label
    boxed = {index(label) for label in made.lowered.rows.box if label and belongs(label, name)}
    rest = {index(label) for label in made.lowered.rows.inequalities if belongs(label, name)}
    places = sorted(boxed | rest)
    if len(places) != constraint.size:  # sides that are infinite by declaration have no constraint
        assert not boxed or not rest, "the registered formulations do not mix them"
        places = places[: constraint.size]
    return np.array([place in boxed for place in places])


@pytest.mark.parametrize(("formulation", "robot", "mode"), cases(FEW))
def test_compiled_commands_are_the_interpreted_ones(formulation: str, robot: str, mode: str) -> None:
    made, _ = both(formulation, robot, mode)
    step, reference = compiled(robot, formulation, mode, quick=True), make_step(arm(robot), formulation, mode)
    rng = np.random.default_rng(1)
    solved = 0
    for trial in range(30):
        q = arm(robot).random_configuration(rng)
        if trial % 2:
            low, high = np.maximum(arm(robot).q_min, -np.pi), np.minimum(arm(robot).q_max, np.pi)
            q = np.where(rng.random(q.size) < 0.4, np.where(rng.random(q.size) < 0.5, low + 1e-3, high - 1e-3), q)
        inputs = inputs_at(made.lowered, q, rng)
        result, wanted = step(**inputs), reference(**inputs)
        assert result.status is wanted.status, (formulation, robot, mode, inputs)
        if wanted.status is Status.SOLVED:
            scale = max(1.0, float(np.abs(wanted.qd).max()))
            assert np.abs(result.qd - wanted.qd).max() <= TOLERANCE * scale, (formulation, robot, mode, inputs)
            solved += 1
    assert solved >= 25
