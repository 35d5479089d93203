"""The check of the invariants: that it passes what is right, and names what is made wrong on purpose."""

from __future__ import annotations

import dataclasses
import functools
import json
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from typer.testing import CliRunner

from kinqp.benchmarks.invariants import Block, InvariantsError, Row, States, arm, read_rows, run, run_block, to_markdown
from kinqp.benchmarks.invariants.__main__ import make_blocks
from kinqp.benchmarks.invariants.answers import (
    Answers,
    judge_answers,
    judge_bad_input,
    judge_commands,
    recorded_step,
    solve_all,
)
from kinqp.benchmarks.invariants.compiled import judge_compiled, judge_parity
from kinqp.benchmarks.invariants.declared import _primal as primal
from kinqp.benchmarks.invariants.declared import judge_declared
from kinqp.benchmarks.invariants.states import KINDS, StateSet, mode_rows
from kinqp.benchmarks.invariants.worth import judge_worth
from kinqp.formulations import Mode, get_formulation
from kinqp.robots import RobotError
from kinqp.solvers import QP, RawSolution, Solution, Solver, Status, get_solver
from tests.codegen.compiled import compiled
from tests.formulations.reference import bounds_at

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from kinqp.control import InterpretedStep

    Array = NDArray[np.float64]

MODE = "fix-orientation"
# Of state 8 of seed 0, the first three of each: q, v, and qd_prev as parts of its bounds.
PUBLISHED = (
    (1.5410122080874311, 1.1556775066275669, -2.073061636172432),
    (0.006625102952336968, -0.004970970179119779, -0.008267608761237147),
    (-0.0061319380679893, -0.005237446629931384, -0.009629136079424979),
)


@functools.cache
def states(robot: str = "lbr_med14", mode: str = MODE, count: int = 32) -> StateSet:
    return States(arm(robot), Mode.parse(mode), 0).take(count)


@functools.cache
def interpreted() -> tuple[InterpretedStep, Answers]:
    step, recorder = recorded_step(arm("lbr_med14"), get_formulation("joint-space"), Mode.parse(MODE))
    return step, solve_all(step, recorder, get_solver("active-set"), states(), {})


def row() -> Row:
    return Row(formulation="joint-space", robot="lbr_med14", mode=MODE, solver="any")


class Liar(Solver):
    """Says "solved" of a point that is none: the right one, moved."""

    name = "liar"

    def __init__(self) -> None:
        super().__init__(tolerance=1e-9)
        self.honest = get_solver("active-set")

    def _setup(self, qp: QP) -> None:
        pass

    def _update(self, qp: QP) -> None:
        pass

    def _solve(self, qp: QP) -> RawSolution:
        right = self.honest.solve(qp)
        x = right.x + 0.01 * np.random.default_rng(qp.n).normal(size=qp.n)
        return RawSolution(claimed=Status.SOLVED, x=x, y=right.y, z=right.z, z_box=right.z_box)


class PassesTheJudge:
    """Hands out a wrong answer that was never judged: half of the way to rest, which keeps limits and locked rows."""

    def __init__(self) -> None:
        self.honest = get_solver("active-set")

    def solve(self, qp: QP) -> Solution:
        right = self.honest.solve(qp)
        assert qp.x_feasible is not None
        return dataclasses.replace(right, x=0.5 * (right.x + qp.x_feasible))


def test_a_state_is_its_number_and_all_kinds_are_there() -> None:
    few, many = States(arm("ur5e"), Mode.parse("line:z"), 3).take(9), States(arm("ur5e"), Mode.parse("line:z"), 3)
    for index in range(9):
        kind, q, v, _ = many.draw(index)
        assert kind == few.kinds[index] == KINDS[index % 8]
        np.testing.assert_array_equal(q, few.q[index])
        np.testing.assert_array_equal(v, few.v[index])
    assert not np.array_equal(States(arm("ur5e"), Mode.parse("line:z"), 4).draw(0)[1], few.q[0])


@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e", "panda"])
def test_states_reach_what_they_are_for(robot: str) -> None:
    some = states(robot, MODE, 96)
    assert np.isfinite(some.q).all()
    on_bound = (some.qd_prev == some.low) | (some.qd_prev == some.high)
    assert ((some.qd_prev >= some.low) & (some.qd_prev <= some.high)).all()
    assert (on_bound & (some.qd_prev != 0.0)).all(axis=1).any()
    assert not some.v.any(axis=1).all()
    assert np.abs(some.v).max() > 100.0
    sigma = []
    for kind, q in zip(some.kinds, some.q, strict=True):
        if kind == "singular":
            rows = mode_rows(arm(robot), Mode.parse(MODE), q)
            whole, locked = (np.linalg.svd(x, compute_uv=False)[-1] for x in (rows, rows[3:]))
            sigma.append(min(whole, locked))
    assert sum(x < 1e-3 for x in sigma) >= len(sigma) // 2
    assert min(sigma) < 1e-7


def test_last_accelerations_are_unknown_on_their_bounds_within_and_beyond() -> None:
    some, many = States(arm("ur5e"), Mode.parse(MODE), 3), states("ur5e", MODE, 200)
    np.testing.assert_array_equal(some.take(5).qdd_prev, some.take(9).first(5).qdd_prev)
    share = np.abs(many.qdd_prev / arm("ur5e").qdd_max)
    assert not np.isnan(share).any()
    unknown, finite = np.isinf(share), np.where(np.isinf(share), 0.0, share)
    kinds = {
        "unknown": unknown.all(axis=1),
        "unknown in part": unknown.any(axis=1) & ~unknown.all(axis=1),
        "on bounds": (finite == 1.0).any(axis=1) & (finite <= 1.0).all(axis=1),
        "beyond": (finite == 3.0).any(axis=1),
        "within": (finite < 1.0).all(axis=1) & (finite > 0.0).all(axis=1),
        "none": (share == 0.0).all(axis=1),
    }
    least = {"unknown": 20, "unknown in part": 5, "on bounds": 40, "beyond": 10, "within": 30, "none": 5}
    assert {name: int(which.sum()) for name, which in kinds.items() if which.sum() < least[name]} == {}


def test_states_are_those_that_were_published() -> None:
    """What is drawn anew has a stream of its own: seed 0's states are named by number in docs/invariants.md."""
    kind, q, v, share = States(arm("lbr_med14"), Mode.parse(MODE), 0).draw(8)
    assert kind == "inside"
    np.testing.assert_allclose([q[:3], v, share[:3]], PUBLISHED, rtol=1e-15, atol=0.0)


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


def test_a_state_of_infinite_accelerations_is_read_back(tmp_path: Path) -> None:
    found, number = row(), int(np.flatnonzero(np.isinf(states().qdd_prev).any(axis=1))[0])
    found.check("finite", np.arange(len(states().q)) == number, 0.0, states())
    text = json.dumps([found.model_dump(mode="json")], allow_nan=False)
    (tmp_path / "blocks").mkdir()
    (tmp_path / "blocks" / "one.json").write_text(text)
    (read,) = read_rows(tmp_path)
    assert read == found
    for name in ("q", "v", "qd_prev", "qdd_prev"):
        np.testing.assert_array_equal(read.checked["finite"].state[name], getattr(states(), name)[number])


@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e"])
def test_bounds_are_those_of_exact_fractions(robot: str) -> None:
    some = states(robot, MODE, 40)
    for q, low, high in zip(some.q, some.low, some.high, strict=True):
        exact_low, exact_high = bounds_at(arm(robot), q)
        np.testing.assert_allclose(low, exact_low, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(high, exact_high, rtol=1e-9, atol=1e-12)


def test_a_solver_that_lies_is_counted_and_caught() -> None:
    counts = (("active-set", 16), ("tests.benchmarks.test_invariants:Liar", 16))
    honest, liar = run_block(Block("joint-space", "lbr_med14", MODE, counts))
    assert honest.wrong_solved == 0
    assert not honest.violations
    assert liar.wrong_solved == 16
    assert liar.refused == {"inaccurate": 16}
    assert not liar.violations  # the step refuses all of it, and stops


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

    made.set = another  # type: ignore[assignment]  # that is the point
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


def test_a_block_with_everything_in_it() -> None:
    counts = (("active-set", 8), ("clarabel", 8), ("piqp", 8), ("cvxpy", 5))
    rows = run_block(Block("cartesian-error-robust", "panda", "line:z", counts))
    assert [row.solver for row in rows] == ["active-set", "clarabel", "piqp", "cvxpy"]
    for each in rows:
        assert not each.violations
        assert each.states == dict(counts)[each.solver]
        assert {"finite", "bounds", "locked rows", "safe stop", "residuals", "cost", "nan"} <= set(each.checked)
    assert {"cvxpy numbers", "cvxpy answer"} <= set(rows[-1].checked)


def test_what_can_not_be_says_why() -> None:
    counts = (("active-set", 2),)
    (made,) = run_block(Block("joint-space + elbow-range", "ur5e", "free", counts))
    assert made.skipped
    assert made.states == 0
    assert made.skipped in to_markdown([made])
    with pytest.raises(RobotError, match="known name"):
        arm("pandora")


def test_results_are_kept_and_resumed(tmp_path: Path) -> None:
    counts = (("active-set", 3),)
    blocks = [Block("joint-space", "lbr_med14", mode, counts) for mode in ("free", MODE)]
    seen: list[tuple[int, int, str]] = []
    run(blocks[:1], tmp_path, on_progress=lambda *args: seen.append(args))
    first = next((tmp_path / "blocks").glob("*.json"))
    stamp = first.stat().st_mtime_ns
    with pytest.raises(InvariantsError, match="--resume"):
        run(blocks, tmp_path)
    rows = run(blocks, tmp_path, resume=True, on_progress=lambda *args: seen.append(args))
    assert first.stat().st_mtime_ns == stamp
    assert [row.mode for row in rows] == [MODE, "free"]
    assert [done for done, _, _ in seen] == [1, 2]
    assert read_rows(tmp_path) == rows
    with pytest.raises(InvariantsError, match="seed"):
        run([dataclasses.replace(blocks[0], seed=1)], tmp_path, resume=True)
    assert not list(tmp_path.rglob("*.partial"))


def test_blocks_cover_what_is_asked_for() -> None:
    counts = {"active-set": 100}
    blocks = make_blocks(None, ["ur5e"], None, counts, 10, 7)
    names = {block.formulation for block in blocks}
    assert {"joint-space", "hierarchical", "minimum-torque-norm"} <= names
    assert all(block.seed == 7 for block in blocks)
    assert {dict(block.counts)["active-set"] for block in blocks if "+" in block.formulation} == {10}
    assert len([block for block in blocks if block.formulation == "joint-space"]) == 7


def test_command_line(tmp_path: Path) -> None:
    import typer

    from kinqp.benchmarks.invariants.__main__ import main

    app = typer.Typer()
    app.command()(main)
    chosen = ["--formulation", "joint-space", "--robot", "lbr_med14", "--mode", "free", "--out", str(tmp_path / "r")]
    good = CliRunner().invoke(app, [*chosen, "--solver", "active-set=4", "--solver", "piqp", "--states", "2"])
    assert good.exit_code == 0, good.output
    assert "| joint-space | piqp | 1 | 2 |" in good.output
    assert (tmp_path / "r" / "table.md").read_text().startswith("## Formulation by solver")
    again = CliRunner().invoke(app, [*chosen, "--solver", "active-set=4"])
    assert again.exit_code == 1
