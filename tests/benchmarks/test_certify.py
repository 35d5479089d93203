"""The proved bound on the active set's iterations: regions hold every hand once, the compiled tick agrees in each."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from kinqp.benchmarks.certify import (
    DependentRowsError,
    Slice,
    SliceError,
    certify,
    drawn_states,
    enumerate_paths,
    every_bound,
    follow,
    parse_side,
    read_certificates,
    read_state,
)
from kinqp.benchmarks.certify.cone import rounded
from kinqp.benchmarks.certify.reach import reach
from kinqp.benchmarks.worst_case import CaseError
from kinqp.cli.app import app
from kinqp.codegen import CompiledStep, compile_step
from kinqp.control import InterpretedStep, make_step
from kinqp.formulations import CartesianError, JointSpace, Mode
from kinqp.robots import load_robot
from kinqp.solvers import QP, get_solver

if TYPE_CHECKING:
    from pathlib import Path

MODE = "fix-orientation"
ROBOT = load_robot("lbr_med14")
# A joint on its limit, one near it, the others inside.
Q = np.array([0.3, 0.7, -0.4, float(ROBOT.q_min[3]), 0.5, float(ROBOT.q_max[5]) - 1e-5, -0.2])


BY_BOUNDS = {name: make_step(ROBOT, CartesianError(bounds=name), "line:z") for name in ("viable", "thesis")}


@pytest.fixture(scope="module")
def interpreted() -> InterpretedStep:
    return make_step(ROBOT, CartesianError(), MODE)


@pytest.fixture(scope="module")
def compiled() -> CompiledStep:
    return compile_step(ROBOT, CartesianError(), Mode.parse(MODE))


# ---- The method ----


def _solver_steps(M: np.ndarray, v: np.ndarray, low: np.ndarray, high: np.ndarray) -> int:
    task, n = M @ v, M.shape[1]
    solution = get_solver("active-set").solve(QP(H=np.eye(n), g=np.zeros(n), C=M, l=low - task, u=high - task))
    assert solution.solved
    return solution.iterations


@pytest.mark.parametrize(
    ("shape", "seed", "expected"),
    [
        # Found before by another programme, by linear programs in floating point.
        ((3, 2), 0, 6),
        ((3, 3), 3, 7),
        pytest.param((4, 2), 1, 10, marks=pytest.mark.long),
        pytest.param((4, 3), 1, 11, marks=pytest.mark.long),
    ],
)
def test_with_all_bounds_free_the_bound_is_attained_and_never_passed(
    shape: tuple[int, int], seed: int, expected: int
) -> None:
    M = np.random.default_rng(seed).normal(size=shape)
    found = enumerate_paths(*every_bound(M))
    assert found.iterations == found.worst.iterations == expected
    rng, (nv, n) = np.random.default_rng(1), shape
    about = np.array([float(x) for x in found.worst.theta])
    about /= np.linalg.norm(about)
    most = 0
    for index in range(1_000):
        theta = about * (1.0 + (10.0 ** rng.uniform(-6, -1)) * rng.normal(size=about.size))
        if index % 2:
            theta = np.concatenate([rng.normal(size=n), 10.0 ** rng.uniform(-4, 1, 2 * nv)])
        most = max(most, _solver_steps(M, theta[:n], -np.abs(theta[n : n + nv]), np.abs(theta[n + nv :])))
    assert most == expected


def test_one_row_takes_one_step_and_so_does_one_direction() -> None:
    assert enumerate_paths(*every_bound(np.array([[2.0]]))).counts == {0: 1, 1: 2}
    # By hand: in one direction the farthest row is outside last; on it all others hold.
    assert enumerate_paths(*every_bound(np.array([[1.0], [0.5], [-2.0]]))).iterations == 1


def test_rows_of_zeros_take_no_part_and_equal_ones_are_no_tie_for_ever() -> None:
    assert enumerate_paths(*every_bound(np.array([[1.0, 0.0], [0.0, 0.0]]))).iterations == 1
    found = enumerate_paths(*every_bound(np.array([[1.0, 1.0], [1.0, 1.0], [0.0, 1.0]])))
    assert found.iterations < 8


def test_rows_that_rounding_calls_dependent_are_refused() -> None:
    with pytest.raises(DependentRowsError, match="depend on others to rounding"):
        enumerate_paths(*every_bound(np.array([[1.0, 1.0], [1.0, 1.0 + 1e-14], [0.0, 1.0]])))


# ---- On a robot ----


def test_regions_hold_every_hand_once_and_the_compiled_tick_agrees(
    interpreted: InterpretedStep, compiled: CompiledStep
) -> None:
    slice_ = Slice(interpreted, Q, speed=1.0)
    found = slice_.enumerate()
    rng = np.random.default_rng(0)
    for v in rng.uniform(-1.0, 1.0, (150, 3)) * 10.0 ** rng.uniform(-3, 0, (150, 1)):
        theta = rounded(np.append(v, 1.0))
        at = [region for region in found.regions if all(condition.holds(theta) for condition in region.conditions)]
        assert len(at) == 1
        assert follow(slice_.method(theta), theta) == (at[0].iterations, at[0].active)
        tick = compiled(Q, v)
        assert tick.iterations == at[0].iterations <= found.iterations
        sides = {f"joint limits[{row}] {'lower' if sign < 0 else 'upper'}" for row, sign in at[0].active}
        assert set(tick.active) == sides


def test_a_certificate_is_attained_and_holds_in_every_region(
    interpreted: InterpretedStep, compiled: CompiledStep
) -> None:
    found = certify(Slice(interpreted, Q, speed=0.5), compiled)
    assert found.attained.compiled == found.attained.proved <= found.iterations
    assert found.attained.proved >= 3
    assert found.agreement.differing == found.agreement.refused == 0
    assert found.agreement.compared > 2 * sum(found.regions.values())
    assert np.abs(found.attained.v).max() <= 0.5
    # More is asked of the hand, more can happen; and all of it with any.
    faster = certify(Slice(interpreted, Q, speed=1.0), compiled, samples=0)
    assert found.iterations <= faster.iterations


def test_free_bounds_are_met_through_position_limits(interpreted: InterpretedStep, compiled: CompiledStep) -> None:
    fixed = Slice(interpreted, Q, speed=0.3)
    free = Slice(interpreted, Q, free=((1, 1),), speed=0.3)
    assert {piece.method.m_free for piece in free.pieces} == {3}
    found = certify(free, compiled, samples=1)
    assert found.agreement.differing == 0
    assert found.agreement.compared > 0
    assert found.attained.compiled == found.attained.proved
    assert found.iterations >= fixed.enumerate().iterations
    v, inputs = free.inputs(np.array([0.1, 0.2, -0.1, 1.0, 0.25]))
    assert interpreted.evaluate(Q, v, **inputs).qd_hi[1] == pytest.approx(0.25, abs=1e-9)


@settings(deadline=None)
@given(st.floats(0.0, 2.0), st.floats(0.5, 20.0), st.sampled_from(["viable", "thesis"]))
def test_reach_inverts_the_bound(bound: float, qdd_max: float, name: str) -> None:
    step = BY_BOUNDS[name]
    far = np.full(7, reach(name, bound, qdd_max, 1e-3))
    limits = {"qd_max": np.full(7, 2.0), "qdd_max": np.full(7, qdd_max), "q_max": far}
    qd_hi = step.evaluate(np.zeros(7), np.zeros(1), **limits).qd_hi
    np.testing.assert_allclose(qd_hi, bound, atol=1e-12, rtol=1e-9)


def test_what_is_no_slice_is_refused(interpreted: InterpretedStep) -> None:
    with pytest.raises(SliceError, match="expected cartesian-error"):
        Slice(make_step(ROBOT, JointSpace(), MODE), Q)
    with pytest.raises(SliceError, match="speed: expected more than 0"):
        Slice(interpreted, Q, speed=0.0)
    with pytest.raises(SliceError, match="each once"):
        Slice(interpreted, Q, free=((1, 1), (1, 1)))
    with pytest.raises(SliceError, match="got task_weight"):
        Slice(interpreted, Q, {"task_weight": np.ones(3)})
    for text in ("7:lower", "1:left", "1", "-1:upper"):
        with pytest.raises(SliceError, match="as 3:lower"):
            parse_side(text, 7)
    assert parse_side("3:lower", 7) == (3, -1)


# ---- Files and the command ----


def test_the_command_writes_what_can_be_replayed(tmp_path: Path) -> None:
    state, out = tmp_path / "state.json", tmp_path / "certificates.json"
    state.write_text(json.dumps({"q": Q.tolist(), "limits": {"qd_max": (0.5 * ROBOT.qd_max).tolist()}}))
    command = ["certify", "--robot", "lbr_med14", "--mode", "plane:0,1,0", "--state", str(state), "--out", str(out)]
    made = CliRunner().invoke(app, [*command, "--speed", "0.2", "--free", "2:upper"])
    assert made.exit_code == 0, made.output
    found = read_certificates(out)
    (only,) = found.certificates
    assert only.free == ["2:upper"]
    assert only.attained.compiled == only.attained.proved > 0
    again = CliRunner().invoke(app, ["certify", "--replay", str(out)])
    assert again.exit_code == 0, again.output
    assert "As proved." in again.output
    text = json.loads(out.read_text())
    text["certificates"][0]["attained"]["v"] = [1e-6, 0.0]
    out.write_text(json.dumps(text))
    assert CliRunner().invoke(app, ["certify", "--replay", str(out)]).exit_code == 1


def test_states_come_from_draws_or_files(tmp_path: Path, compiled: CompiledStep) -> None:
    first, second = drawn_states(compiled, 2, 5)
    assert not np.array_equal(first[0], second[0])
    assert np.array_equal(drawn_states(compiled, 2, 5)[1][0], second[0])
    path = tmp_path / "state.json"
    path.write_text(
        json.dumps({"kind": "kinqp worst case", "most": {"q": Q.tolist(), "limits": {"qd_max": [1.0] * 7}}})
    )
    q, limits = read_state(path, 7)
    assert np.array_equal(q, Q)
    assert np.array_equal(limits["qd_max"], np.ones(7))
    for wrong in ("{}", "[", json.dumps({"q": [1.0]})):
        path.write_text(wrong)
        with pytest.raises(CaseError, match=r"state\.json: expected a file of kinqp worst-case"):
            read_state(path, 7)
    with pytest.raises(CaseError, match="expected a file that kinqp certify has written"):
        read_certificates(path)
