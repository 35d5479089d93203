"""Problems written in cvxpy as formulations: the same numbers, the same answers, C included."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from unittest import mock

import cvxpy as cp
import numpy as np
import pytest
from cvxpy.atoms.sum_squares import sum_squares

import kinqp.codegen.step as step_module
from kinqp.benchmarks import make_config, sweep
from kinqp.codegen import CompiledStep, CurvatureError, compile_step
from kinqp.codegen.model import step_code
from kinqp.codegen.render import render_step
from kinqp.control import make_step
from kinqp.formulations import Evaluator, Formulation, InputError, Instance, Mode, lower
from kinqp.solvers import Status, solve
from tests.codegen.compiled import QUICK_FLAGS
from tests.formulations.in_cvxpy import DEFINITE, FLAT, NV, joint_space, parameter, problem, unnamed
from tests.formulations.inputs import inputs_at
from tests.formulations.reference import MODES, evaluator
from tests.robots.arms import arm

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.formulations.reference import Array

ROBOT = arm("lbr_med14")
MODE = Mode.fix_orientation()
TIGHT = {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-12, "tol_feas": 1e-12}


def near_limits(rng: np.random.Generator) -> Array:
    q = ROBOT.random_configuration(rng)
    some = rng.random(NV) < 0.3
    side = np.where(rng.random(NV) < 0.5, ROBOT.q_min + 1e-4, ROBOT.q_max - 1e-4)
    return np.asarray(np.where(some, side, q))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e"])
def test_joint_space_has_the_numbers_and_names_of_ours(robot: str, mode: str) -> None:
    read = Mode.parse(mode)
    theirs = lower(joint_space(arm(robot).nv, read.m_free, read.m_fixed), arm(robot), read)
    ours = evaluator(robot, "joint-space", mode)
    assert theirs.rows == ours.lowered.rows
    assert theirs.variables == ours.lowered.variables
    rng, numbers = np.random.default_rng(0), Evaluator(theirs)
    for _ in range(3):
        q, v, v_fixed = (
            arm(robot).random_configuration(rng),
            rng.normal(size=read.m_free),
            rng.normal(size=read.m_fixed),
        )
        weights = {
            "task_weight": rng.uniform(0.5, 2, read.m_free),
            "joint_weight": rng.uniform(1e-4, 1e-3, arm(robot).nv),
        }
        given = {"q": q, "v": v, "v_fixed": v_fixed} | weights
        one, two = numbers(**given), ours(**given)
        for key in ("H", "g", "A", "b", "C", "l", "u", "lb", "ub"):
            np.testing.assert_allclose(getattr(one.qp, key), getattr(two.qp, key), rtol=1e-14, err_msg=key)
        np.testing.assert_array_equal(one.K, two.K)
        np.testing.assert_array_equal(one.k, two.k)


@pytest.mark.parametrize("make", [joint_space, unnamed])
def test_joint_space_gives_the_commands_of_ours(make: Callable[[], Formulation]) -> None:
    ours, theirs, compiled = (
        make_step(ROBOT, "joint-space", MODE),
        make_step(ROBOT, make(), MODE),
        quickly_compiled(make()),
    )
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(60):
        q, v = near_limits(rng), 0.3 * rng.normal(size=3)
        wanted = ours(q, v)
        assert wanted.status is Status.SOLVED
        scale = max(1.0, float(np.abs(wanted.qd).max()))
        for result in (theirs(q, v), compiled(q, v)):
            assert result.status is Status.SOLVED
            assert np.abs(result.qd - wanted.qd).max() <= 1e-9 * scale
        held += bool(wanted.active)
    assert held >= 20


def quickly_compiled(made: Formulation) -> CompiledStep:
    """Compile with less optimisation, which changes no bit of the answers."""
    with mock.patch.object(step_module, "STEP_FLAGS", QUICK_FLAGS):
        return compile_step(ROBOT, made, MODE)


def by_cvxpy(written: cp.Problem, command: Any, instance: Instance, given: dict[str, Array]) -> Array:
    """Have cvxpy solve the problem as it was written, with the numbers of the tick."""
    known = {name: getattr(instance, name) for name in ("J_free", "J_fixed", "qd_lo", "qd_hi")} | given
    known |= {"M": ROBOT.mass_matrix(given["q"]), "qd_fixed": np.linalg.pinv(instance.J_fixed) @ given["v_fixed"]}
    for own in {p.id: p for p in (*written.parameters(), *command.parameters())}.values():
        if own.name() in known:
            own.value = known[own.name()]
    written.solve(solver="CLARABEL", **TIGHT)  # type: ignore[no-untyped-call]  # cvxpy has no stubs for it
    assert written.status == cp.OPTIMAL
    return np.asarray(command.value)


@pytest.mark.parametrize("kind", [*DEFINITE, *FLAT])
def test_answers_are_those_of_cvxpy(kind: str) -> None:
    written, command = problem(kind)
    made = Formulation.from_cvxpy(written, command=command, name=kind)
    lowered = lower(made, ROBOT, MODE)
    numbers, step = Evaluator(lowered), make_step(ROBOT, made, MODE)
    compiled: CompiledStep | None = None
    if kind in FLAT:
        with pytest.raises(CurvatureError, match=rf"^{kind}: expected an objective that gives every variable weight"):
            quickly_compiled(made)
    else:
        compiled = quickly_compiled(made)
    rng = np.random.default_rng(2)
    for _ in range(8):
        given = inputs_at(lowered, near_limits(rng), rng)
        v_fixed = 0.01 * rng.normal(size=3) if kind == "shifted" else np.zeros(3)
        given |= {"v_fixed": v_fixed} if kind == "shifted" else {}
        instance = numbers(**given)
        solution = solve(instance.qp)
        assert solution.solved
        wanted = by_cvxpy(written, command, instance, given | {"v_fixed": v_fixed})
        np.testing.assert_allclose(instance.K @ solution.x + instance.k, wanted, atol=1e-6)
        result = step(**given)
        assert result.status is Status.SOLVED, result.message
        if compiled is not None:
            np.testing.assert_allclose(compiled(**given).qd, result.qd, atol=1e-9)


def test_variables_and_rows_are_those_that_were_written() -> None:
    written, command = problem("largest")
    lowered = lower(Formulation.from_cvxpy(written, command=command, name="largest"), ROBOT, MODE)
    assert lowered.variables["qd"].stop - lowered.variables["qd"].start == NV
    assert lowered.rows.equalities == tuple(f"constraint 1[{i}]" for i in range(3))
    assert [name for name in lowered.rows.box if name] == [f"constraint 2 / constraint 3[{i}]" for i in range(NV)]
    assert lowered.n == 2 * NV + 1  # the absolute values and their bound; none for the sums of squares


def test_the_same_problem_gives_the_same_c_whatever_cvxpy_made_before() -> None:
    def source() -> dict[str, str]:
        return render_step(step_code(ROBOT, unnamed(), [MODE], "kinqp_unnamed"))

    first = source()
    _ = [cp.Variable(2) for _ in range(7)], [cp.Parameter() for _ in range(3)]
    assert source() == first


def test_it_is_swept(tmp_path: Path) -> None:
    theirs, ours = "tests.formulations.in_cvxpy:joint_space", "joint-space"
    config = make_config(
        {
            "formulations": [theirs, ours],
            "scenarios": ["tests.benchmarks.tiny:tiny"],
            "solvers": ["active-set"],
            "repeats": 1,
        }
    )
    store = sweep(config, tmp_path / "out")
    qd = {cell.formulation: np.array(store.ticks(cell)["qd"].to_list()) for cell in store.manifest.cells}
    assert np.abs(qd[ours]).max() > 1e-4
    np.testing.assert_array_equal(qd[theirs], qd[ours])


def test_inputs_of_its_own() -> None:
    qd, wish = cp.Variable(NV), parameter("wish", NV)
    weight = parameter("weights", NV, NV, symmetric=True, value=np.eye(NV) + np.eye(NV, k=1) + np.eye(NV, k=-1))
    made = Formulation.from_cvxpy(
        cp.Problem(cp.Minimize(sum_squares(qd - wish) + sum_squares(weight @ qd))), command=qd, name="own"
    )
    numbers = Evaluator(lower(made, ROBOT, MODE))
    q, v, rng = np.zeros(NV), np.zeros(3), np.random.default_rng(3)
    wished = rng.normal(size=NV)
    with pytest.raises(InputError, match=r"^wish: expected shape \(7,\)"):
        numbers(q=q, v=v)
    W = np.eye(NV) + np.eye(NV, k=1) + np.eye(NV, k=-1)
    np.testing.assert_allclose(numbers(q=q, v=v, wish=wished).qp.H, 2 * (np.eye(NV) + W.T @ W), atol=1e-14)
    np.testing.assert_allclose(numbers(q=q, v=v, wish=wished).qp.g, -2 * wished, atol=1e-14)
    other = rng.normal(size=(NV, NV))
    other = other + other.T
    H = numbers(q=q, v=v, wish=wished, weights=other.flatten(order="F")).qp.H
    np.testing.assert_allclose(H, 2 * (np.eye(NV) + other.T @ other), atol=1e-13)


def test_a_feasible_point_is_that_of_ours_while_nothing_drifts() -> None:
    theirs, ours = (
        Evaluator(lower(joint_space(), ROBOT, MODE)),
        evaluator("lbr_med14", "joint-space", "fix-orientation"),
    )
    given = {"q": np.full(NV, 0.4), "v": np.array([0.1, -0.2, 0.3])}
    point, wanted = theirs(**given).qp.x_feasible, ours(**given).qp.x_feasible
    assert point is not None
    assert wanted is not None
    np.testing.assert_array_equal(point, wanted)
    np.testing.assert_array_equal(point, [-0.1, 0.2, -0.3, *np.zeros(NV)])
    # What needs one can be used: the thesis's solver, and C that keeps to admissible points when it runs out of steps.
    step = make_step(ROBOT, joint_space(), MODE, "thesis-active-set")
    assert step(**given).status is Status.SOLVED
    with mock.patch.object(step_module, "STEP_FLAGS", QUICK_FLAGS):
        stopped = compile_step(ROBOT, joint_space(), MODE, feasible=True, max_iterations=0)
    on_limit = np.deg2rad([0.0, 40.0, 0.0, -119.999, 0.0, 20.0, 0.0])
    result = stopped(on_limit, [-0.3, 0.0, 0.0])
    assert result.status is Status.MAX_ITERATIONS
    assert result.qd[3] >= numbers_at(on_limit).qd_lo[3] - 1e-9


def numbers_at(q: Array) -> Instance:
    return evaluator("lbr_med14", "joint-space", "fix-orientation")(q=q, v=np.zeros(3))
