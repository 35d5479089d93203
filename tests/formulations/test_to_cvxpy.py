"""A declaration written as a cvxpy problem: DPP, the same numbers, the same answers from solvers that are not ours."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

import casadi as ca
import cvxpy
import numpy as np
import pytest

from kinqp.formulations import Formulation, InputError, Mode, QuadraticProgram, Tick
from kinqp.formulations.to_cvxpy import INFINITE, CvxpyProblem, NotSolvedError
from kinqp.solvers import solve
from tests.formulations.inputs import inputs_at
from tests.formulations.reference import MODES, ONE_QP, evaluator
from tests.robots.arms import arm

if TYPE_CHECKING:
    from tests.formulations.reference import Array

TIGHT: dict[str, dict[str, Any]] = {
    "CLARABEL": {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-12, "tol_feas": 1e-12},
    "OSQP": {"eps_abs": 1e-10, "eps_rel": 1e-10, "max_iter": 200_000},
    # It would add 1e-7 to H, a thousandth of the joint weight; and it takes back answers whose auxiliary rows, which
    # cvxpy adds, are off by some 1e-5, though the command is right. The command is what is judged here.
    "HIGHS": {"qp_regularization_value": 0.0, "primal_feasibility_tolerance": 1e-4},
}
# What these solvers are worth on these problems, whose smallest curvature is the joint weight of 1e-4 [rad/s].
ACCURACY = 1e-5


@cache
def written(robot: str, formulation: str | Formulation, mode: str) -> CvxpyProblem:
    return evaluator(robot, formulation, mode).lowered.formulation.to_cvxpy(arm(robot), mode)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("formulation", ONE_QP)
def test_it_is_dpp_and_names_everything(formulation: str, mode: str) -> None:
    made = written("lbr_med14", formulation, mode)
    program = made.lowered.program
    assert made.problem.is_dpp()
    assert made.problem.is_qp()
    assert list(made.variables) == list(program.variables)
    assert list(made.constraints) == [rows.name for rows in program.rows]
    assert all(name.isidentifier() for name in made.parameters)
    assert all(variable.name().isidentifier() for variable in made.variables.values())
    assert {p.name() for p in made.problem.parameters()} <= set(made.parameters)
    for name, constraints in made.constraints.items():
        assert {constraint.label for constraint in constraints} == {name}


@pytest.mark.parametrize("solver", TIGHT)
@pytest.mark.parametrize("formulation", ONE_QP)
def test_solved_by_others_it_gives_our_commands(formulation: str, solver: str) -> None:
    robot, rng = arm("lbr_med14"), np.random.default_rng(0)
    made, numbers = (
        written("lbr_med14", formulation, "fix-orientation"),
        evaluator("lbr_med14", formulation, "fix-orientation"),
    )
    held = 0
    for trial in range(8):
        q = robot.random_configuration(rng)
        if trial % 2:  # three joints on or near a limit
            some = rng.choice(7, 3, replace=False)
            side = np.where(rng.random(3) < 0.5, robot.q_min[some], robot.q_max[some])
            q[some] = side * rng.choice([1.0, 1.0 - 1e-5], 3)
        inputs = inputs_at(made.lowered, q, rng, speed=0.2)
        instance = numbers(**inputs)
        solution = solve(instance.qp)
        assert solution.solved
        made.set(**inputs)
        made.problem.solve(solver=solver, **TIGHT[solver])
        np.testing.assert_allclose(made.command(), instance.K @ solution.x + instance.k, atol=ACCURACY)
        held += bool(np.abs(np.concatenate((solution.z, solution.z_box))).max(initial=0.0) > 1e-6)
    assert held >= 2


@dataclass(frozen=True)
class Odd(Formulation):
    """One-sided rows, sides that are infinite at run time, a slack of one entry, a linear cost, rows of numbers."""

    name: ClassVar[str] = "odd"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State it."""
        qd, slack = qp.variable("qd", tick.nv), qp.variable("slack", 1)
        limit = tick.parameter("limit", np.inf, size=tick.nv, may_be_infinite=True)
        a = tick.parameter("a", 2.0)
        qp.minimize(tick.J_free @ qd - tick.v, weight=3.0, name="task")
        qp.minimize(ca.vertcat(qd, 0.5 * slack - a), weight=a * 0.1, name="rest")
        qp.minimize(a * np.ones(2), name="nothing of the variables")
        qp.minimize_linear(0.1 * slack + 0.01 * tick.v[0] * qd[1] + 5)
        qp.between(np.array([-0.1, -np.inf, 0.3]), ca.vertcat(qd[0], 2 * qd[1] + 1, -3 * slack), np.inf, name="partly")
        qp.between(-np.inf, a * slack + qd[3] * np.ones(2), np.array([5.0, 0.2]), name="above")
        qp.between(-limit, qd, limit, name="may be off")
        qp.equal(qd[4], a * slack + 0.5, name="tie")
        qp.command(qd + 0.1 * slack)


def test_what_the_registered_ones_lack() -> None:
    made, numbers = Odd().to_cvxpy(arm("lbr_med14"), Mode.position()), evaluator("lbr_med14", Odd(), "position")
    rng = np.random.default_rng(1)
    assert [len(made.constraints[name]) for name in ("partly", "above", "may be off", "tie")] == [1, 1, 2, 1]
    assert made.constraints["partly"][0].size == 2
    for limit in (np.inf, 0.4, 0.05):
        q, v = arm("lbr_med14").random_configuration(rng), 0.2 * rng.normal(size=3)
        given = {"q": q, "v": v, "limit": np.full(7, limit), "a": 1.5}
        made.set(**given)
        made.problem.solve(solver="CLARABEL", **TIGHT["CLARABEL"])
        instance = numbers(**given)
        solution = solve(instance.qp)
        assert solution.solved
        np.testing.assert_allclose(made.command(), instance.K @ solution.x + instance.k, atol=1e-6)
        left_out = 0.5 * 3.0 * float(v @ v) + 0.5 * 0.1 * 1.5 * 1.5**2  # |r|^2 at zero, which no solver needs
        assert made.problem.value - instance.qp.objective(solution.x) == pytest.approx(left_out, abs=1e-7)
    assert made.parameters["may_be_off_upper"].value[0] == 0.05
    made.set(q=q, v=v)
    np.testing.assert_array_equal(made.parameters["may_be_off_upper"].value, np.full(7, INFINITE))


def test_duals_belong_to_named_rows() -> None:
    """On its lower limit, pushed further: one multiplier, on that joint's lower side, as our own solver has it."""
    made, numbers = written("lbr_med14", "joint-space", "position"), evaluator("lbr_med14", "joint-space", "position")
    q = np.deg2rad([0.0, 40.0, 0.0, -120.0, 0.0, 20.0, 0.0])
    given: dict[str, Array] = {"q": q, "v": np.array([-0.2, 0.0, 0.1])}
    made.set(**given)
    made.problem.solve(solver="CLARABEL", **TIGHT["CLARABEL"])
    lower, upper = (constraint.dual_value for constraint in made.constraints["joint limits"])
    z = solve(numbers(**given).qp).z_box[3:]
    assert z[3] < -1e-5
    np.testing.assert_allclose(upper - lower, z, atol=1e-7)


def test_mistakes_are_one_sentence() -> None:
    made = Odd().to_cvxpy(arm("lbr_med14"), "position")
    with pytest.raises(NotSolvedError, match=r"^command: expected set\(\) and a solved problem, got status None"):
        made.command()
    with pytest.raises(InputError, match=r"^v: expected shape"):
        made.set(q=np.zeros(7))
    with pytest.raises(InputError, match=r"^speed: expected an input among q, v, .*limit, a"):
        made.set(q=np.zeros(7), v=np.zeros(3), speed=1.0)
    with pytest.raises(InputError, match=r"^q: expected finite numbers"):
        made.set(q=np.full(7, np.nan), v=np.zeros(3))
    made.set(q=np.zeros(7), v=np.zeros(3), limit=-1.0)  # sides that cross
    made.problem.solve(solver="CLARABEL")
    assert made.problem.status == cvxpy.INFEASIBLE
    with pytest.raises(NotSolvedError, match="got status infeasible"):
        made.command()
