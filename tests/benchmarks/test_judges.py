"""The judges of the invariants: what is right passes, and what is made wrong on purpose is named."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from kinqp.benchmarks.invariants import arm, to_markdown
from kinqp.benchmarks.invariants.answers import judge_answers, judge_bad_input, judge_commands, recorded_step, solve_all
from kinqp.benchmarks.invariants.compiled import judge_compiled, judge_parity
from kinqp.benchmarks.invariants.declared import _primal as primal
from kinqp.benchmarks.invariants.declared import judge_declared
from kinqp.benchmarks.invariants.worth import judge_worth
from kinqp.formulations import Mode, get_formulation
from kinqp.solvers import QP, Solution, Solver, get_solver
from tests.benchmarks.judged import MODE, interpreted, row, states
from tests.codegen.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class PassesTheJudge:
    """Hands out a wrong answer that was never judged: half of the way to rest, which keeps limits and locked rows."""

    def __init__(self) -> None:
        self.honest = get_solver("active-set")

    def solve(self, qp: QP) -> Solution:
        right = self.honest.solve(qp)
        assert qp.x_feasible is not None
        return dataclasses.replace(right, x=0.5 * (right.x + qp.x_feasible))


@pytest.mark.parametrize("formulation", ["joint-space-robust", "cartesian-error-robust"])
def test_every_step_is_told_the_last_accelerations(formulation: str) -> None:
    """Interpreted, compiled alone and in a batch, declared in cvxpy: all agree, and not with a jerk left unlimited."""
    some, mode = states(), Mode.parse(MODE)
    step, recorder = recorded_step(arm("lbr_med14"), get_formulation(formulation), mode)
    ignorant = dataclasses.replace(some, qdd_prev=np.full_like(some.qdd_prev, np.inf))
    told, untold = (solve_all(step, recorder, get_solver("active-set"), each, {}) for each in (some, ignorant))
    differ = (np.abs(told.qd - untold.qd) > 1e-6).any(axis=1)
    assert not (differ & np.isinf(some.qdd_prev).all(axis=1)).any()
    assert differ.sum() > 4
    made_c = compiled("lbr_med14", formulation, MODE, quick=True)
    found, deaf = row(), row()
    commands = judge_compiled(found, made_c, some, {}, np.zeros_like(some.q))
    apart = judge_parity(found, (step, made_c), some, {}, told, commands)
    judge_worth(found, step, some, {}, commands, apart)
    made = get_formulation(formulation).to_cvxpy(arm("lbr_med14"), MODE)
    judge_declared(found, made, step, some.first(6), {}, told)  # near zero, as the next one, Clarabel misses rows
    assert not found.violations
    assert {"repeat", "batch", "parity", "compiled rows", "nan", "cvxpy answer"} <= set(found.checked)
    # One that isn't told is found out.
    commands = judge_compiled(deaf, made_c, ignorant, {}, np.zeros_like(some.q))
    apart = judge_parity(deaf, (step, made_c), some, {}, told, commands)
    judge_worth(deaf, step, some, {}, commands, apart)
    # Haste allows for it, at its price.
    assert {"parity", "compiled cost"} <= set(deaf.violations)
    assert apart.sum() >= differ.sum() // 2


def test_a_wrong_answer_that_got_past_the_judge_is_a_violation() -> None:
    step, recorder = recorded_step(arm("lbr_med14"), get_formulation("joint-space"), Mode.parse(MODE))
    wrong = solve_all(step, recorder, cast("Solver", PassesTheJudge()), states(), {})
    made = row()
    judge_commands(made, states(), wrong.qd, wrong.eps, wrong.solved, stop=np.zeros_like(wrong.qd))
    judge_answers(made, states(), wrong, interpreted()[1].cost, interpreted()[1].missed)
    assert set(made.violations) == {"residuals", "cost"}
    moving = int(np.sum(states().v.any(axis=1)))
    assert made.violations["residuals"].count >= moving // 2
    found = made.violations["cost"]
    assert found.worst > 0.1
    np.testing.assert_array_equal(found.state["q"], states().q[found.index])
    assert "| joint-space | lbr_med14 | fix-orientation | any | cost |" in to_markdown([made])


def spoilt(name: str) -> dict[str, Any]:
    answers = interpreted()[1]
    qd, eps, solved = answers.qd.copy(), answers.eps.copy(), answers.solved.copy()
    J = states().J_fixed[8]
    push = J.T @ np.ones(3)
    if name == "finite":
        qd[8, 0] = np.nan
    elif name == "bounds":
        qd[8] = states().high[8] + 1e-7
    elif name == "locked rows":
        qd[8] += 1e-8 * push / np.linalg.norm(J @ push)
    elif name == "error":
        eps[8, 0] += 1e-8
    elif name == "safe stop":
        solved[8], qd[8] = False, 1e-9
    return {"qd": qd, "eps": eps, "solved": solved}


def test_right_commands_pass() -> None:
    made = row()
    judge_commands(made, states(), **spoilt(""), stop=np.zeros_like(states().q))
    judge_answers(made, states(), interpreted()[1], interpreted()[1].cost, interpreted()[1].missed)
    assert not made.violations
    assert made.refused == {}


def test_a_cost_is_allowed_what_missed_rows_are_worth_and_no_more() -> None:
    right = interpreted()[1]
    count = len(right.cost)
    for above, count_wrong in ((0.5e-4, 0), (2e-4, count)):
        answers = dataclasses.replace(
            right,
            cost=right.cost + above,
            scale=np.ones(count),
            price=np.full(count, 1e9),
            missed=np.full(count, 1e-13),
        )
        made = row()
        judge_answers(made, states(), answers, right.cost, np.zeros(count))
        assert made.checked["cost"].count == count_wrong


@pytest.mark.parametrize("name", ["finite", "bounds", "locked rows", "error", "safe stop"])
def test_each_broken_invariant_is_named_with_its_state(name: str) -> None:
    made = row()
    judge_commands(made, states(), **spoilt(name), stop=np.zeros_like(states().q))
    assert made.violations[name].index == 8
    assert made.violations[name].count == 1
    assert name in to_markdown([made]).partition("## Violations")[2]


class Spoilt:
    """A compiled step with something wrong."""

    def __init__(self, what: str) -> None:
        self.step, self.what, self.calls = compiled("lbr_med14", "joint-space", MODE, quick=True), what, 0
        bound = 0 if what == "iterations" else self.step.code.max_iterations
        self.code = SimpleNamespace(max_iterations=bound)
        self.inputs = self.step.inputs

    def __call__(self, q: Array, v: Array) -> Any:
        if self.what == "nan":
            q, v = np.nan_to_num(q, posinf=0.0, neginf=0.0), np.nan_to_num(v, posinf=0.0, neginf=0.0)
        result = self.step(q, v)
        return result._replace(qd=np.nextafter(result.qd, 9.0)) if self.what == "batch" else result

    def batch(self, q: Array, v: Array) -> Any:
        self.calls += 1
        result = self.step.batch(q, v)
        if self.what == "repeat" and self.calls == 2:
            result.qd[8, 0] = np.nextafter(result.qd[8, 0], 9.0)
        if self.what == "parity":
            result.qd[0] += 1e-6 * max(1.0, float(np.abs(result.qd[0]).max()))
        return result


@pytest.mark.parametrize("what", ["", "repeat", "batch", "iterations", "nan", "parity"])
def test_a_compiled_step_is_checked(what: str) -> None:
    made, step = row(), cast("Any", Spoilt(what))
    found = judge_compiled(made, step, states(), {}, np.zeros_like(states().q))
    judge_parity(made, (interpreted()[0], step), states(), {}, interpreted()[1], found)
    # A command that is moved breaks other things besides.
    others = {"batch", "error", "locked rows"} if what == "parity" else set()
    assert set(made.violations) - others == {what} - {""}, made.violations


@pytest.mark.parametrize("spoilt_by", [0.0, 0.01])
def test_a_declaration_that_is_another_one_in_cvxpy_is_named(spoilt_by: float) -> None:
    step, answers = interpreted()
    made = get_formulation("joint-space").to_cvxpy(arm("lbr_med14"), MODE)
    honest = made.set

    def another(**inputs: Array) -> None:
        honest(**inputs)
        for parameter in made.parameters.values():
            parameter.value = parameter.value * (1.0 + spoilt_by)

    made.set = another  # type: ignore[assignment]  # a method is replaced, to spoil what it is given
    found = row()
    judge_declared(found, made, step, states().first(8), {}, answers)
    assert ("cvxpy answer" in found.violations) == bool(spoilt_by)
    assert not set(found.violations) - {"cvxpy answer", "cvxpy numbers"}


def test_a_tiny_row_missed_by_less_than_the_tolerance_is_kept() -> None:
    # At (0.5, 0.5) the row is 1e-9, its terms 3e-9.
    qp = QP(H=np.eye(2), g=[0.0, 0.0], C=[[1e-9, 1e-9]], u=[1e-9 - 2e-14])
    assert primal(qp, np.array([0.5, 0.5])) == (pytest.approx(2e-14, rel=1e-3), 0.0)
    far = QP(H=np.eye(2), g=[0.0, 0.0], C=[[1e-9, 1e-9]], u=[0.0])
    assert primal(far, np.array([0.5, 0.5])) == (pytest.approx(1e-9), pytest.approx(1.0 / 3.0))


def test_a_step_that_takes_nan_is_named() -> None:
    made = row()
    judge_bad_input(made, cast("Any", Spoilt("nan")), states(), {})
    assert made.violations["nan"].count == 3
