"""The compiled step as users meet it: determinism, batches, a formulation of one's own, many joints, compilers."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from kinqp.codegen import compile_step
from kinqp.control import make_step
from kinqp.formulations import Mode
from kinqp.robots import Robot, load_robot
from kinqp.solvers import Status
from kinqp.solvers.native import CompilerError
from tests.codegen.compiled import FORMULATIONS, REFERENCE_SOLVER, SPEEDS, Everything, everything, near, ticks
from tests.codegen.lbr import Q, V, hard_ticks, lbr
from tests.codegen.test_parity import check_safe
from tests.robots.arms import arm


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_same_state_same_bits(formulation: str) -> None:
    step = lbr(formulation)
    drawn = [(q, v) for _, q, v in ticks("lbr_med14", "fix-orientation", 60)] + hard_ticks(60)
    first = [step(q, v) for q, v in drawn]
    again = [step(q, v) for q, v in reversed(drawn)][::-1]
    batch = step.batch(np.array([q for q, _ in drawn]), np.array([v for _, v in drawn]))
    for i, (one, two) in enumerate(zip(first, again, strict=True)):
        assert one.qd.tobytes() == two.qd.tobytes() == batch.qd[i].tobytes()
        assert one.eps.tobytes() == two.eps.tobytes() == batch.eps[i].tobytes()
        assert one.sides.tobytes() == two.sides.tobytes() == batch.sides[i].tobytes()
        assert one.status is two.status is batch.status[i]
        assert one.iterations == two.iterations == batch.iterations[i]
    assert max(result.iterations for result in first) > 2


def test_results_are_copies() -> None:
    step = lbr()
    first = step(Q, V)
    kept = first.qd.copy()
    step(Q + 0.2, -V)
    np.testing.assert_array_equal(first.qd, kept)


def test_an_empty_batch_is_empty() -> None:
    result = lbr().batch(np.zeros((0, 7)), np.zeros((0, 3)))
    assert result.qd.shape == (0, 7)
    assert result.status == ()


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_bad_row_of_a_batch_stops_its_own_tick_only(formulation: str, bad: float) -> None:
    step = lbr(formulation)
    Qs, Vs = np.tile(Q, (5, 1)), np.array([V, -V, V, 2 * V, V])
    wanted = step.batch(Qs, Vs)
    Qs[1, 4] = bad
    Vs[3, 0] = bad
    result = step.batch(Qs, Vs)
    assert [status is Status.FAILED for status in result.status] == [False, True, False, True, False]
    assert not result.qd[[1, 3]].any()
    assert not result.sides[[1, 3]].any()
    good = [0, 2, 4]
    assert result.qd[good].tobytes() == wanted.qd[good].tobytes()
    assert result.eps[good].tobytes() == wanted.eps[good].tobytes()


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_drift_correction_moves_the_locked_rows(formulation: str) -> None:
    drift = np.array([0.0, 0.01, -0.005])
    result = lbr(formulation)(Q, V, v_fixed=drift)
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(arm("lbr_med14").jacobian(Q)[3:] @ result.qd, drift, atol=1e-9)
    assert not lbr(formulation)(Q, np.zeros(3)).qd.any()


def test_solvers_without_c_are_refused() -> None:
    with pytest.raises(ValueError, match=r"solver: .* \(active-set, casadi-qrqp\), got 'clarabel'; see make_step"):
        compile_step(arm("lbr_med14"), "cartesian-error", "fix-orientation", "clarabel")


def test_a_formulation_of_ones_own() -> None:
    """A gradient, rows besides the box, inputs without defaults, a command with an offset, no feasible point."""
    step, reference = everything(), make_step(arm("ur5e"), Everything(), "position", REFERENCE_SOLVER)
    rng = np.random.default_rng(6)
    seen: set[str] = set()
    for kind, q, v in ticks("ur5e", "fix-orientation", 48):
        if "zero" in kind:
            continue
        inputs = {"qd_wish": rng.normal(size=6), "qd_prev": rng.normal(size=6)}
        result, wanted = step(q, v, **inputs), reference(q, v, **inputs)
        assert result.status is Status.SOLVED
        if wanted.status is Status.SOLVED:
            np.testing.assert_allclose(result.qd, wanted.qd, rtol=0, atol=1e-8)
        seen |= {name.partition("[")[0] for name in result.active}
    assert seen == {"slack", "difference", "joint limits", "command limits"}


def snake(joints: int) -> str:
    """Write a URDF of revolute joints about x, y and z in turn."""
    axes = ("1 0 0", "0 1 0", "0 0 1")
    parts = ['<robot name="snake">', '<link name="link0"/>']
    for i in range(joints):
        parts += [
            f'<joint name="joint{i + 1}" type="revolute">',
            f'<parent link="link{i}"/><child link="link{i + 1}"/>',
            f'<origin xyz="0.02 {0.01 * (-1) ** i} 0.05" rpy="0 0 {0.1 * i}"/><axis xyz="{axes[i % 3]}"/>',
            '<limit lower="-1.5" upper="1.8" velocity="2" effort="10"/>',
            f'</joint><link name="link{i + 1}"/>',
        ]
    return "\n".join([*parts, "</robot>"])


@pytest.fixture(scope="module")
def thirty_joints(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    path = tmp_path_factory.mktemp("snake") / "snake.urdf"
    path.write_text(snake(30))
    return load_robot(path)


def test_thirty_joints(thirty_joints: Robot) -> None:
    step = compile_step(thirty_joints, "cartesian-error", "position")
    reference = make_step(thirty_joints, "cartesian-error", Mode.position(), REFERENCE_SOLVER)
    rng = np.random.default_rng(0)
    for _ in range(10):
        q = near(thirty_joints.q_min, thirty_joints.q_max, rng)
        v = rng.normal(size=3) * rng.choice(SPEEDS)
        result, wanted = step(q, v), reference(q, v)
        assert result.status is wanted.status is Status.SOLVED
        np.testing.assert_allclose(result.qd, wanted.qd, rtol=0, atol=1e-9)
        check_safe(step, result, q, f"q={q!r}, v={v!r}")


COMPILE = """
import numpy as np
from kinqp.codegen import compile_step
from kinqp.robots import load_robot
step = compile_step(load_robot("ur5e"), "cartesian-error", "position")
print(step(np.full(6, 0.3), [0.1, 0.0, 0.2]).qd.tobytes().hex())
"""


def test_two_processes_may_compile_the_same_step_at_once(tmp_path: Path) -> None:
    environment = os.environ | {"KINQP_CACHE": str(tmp_path / "cache")}
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", COMPILE], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    answers = [process.communicate(timeout=120) for process in processes]
    assert [process.returncode for process in processes] == [0, 0], answers
    assert answers[0][0] == answers[1][0]
    assert len([*(tmp_path / "cache").iterdir()]) == 1


def test_without_a_compiler_the_error_names_the_fix_and_the_rest_works(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("KINQP_CC", "/nonexistent")
    monkeypatch.setenv("KINQP_CACHE", str(tmp_path))
    with pytest.raises(CompilerError, match=r"'/nonexistent', which was not found: install a C compiler, .* KINQP_CC"):
        compile_step(arm("ur5e"), "cartesian-error", "position")
    result = make_step(arm("ur5e"), "cartesian-error", "position", "clarabel")(np.full(6, 0.3), V)
    assert result.status is Status.SOLVED
