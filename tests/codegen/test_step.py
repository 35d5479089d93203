"""The compiled step as users meet it: determinism, mistakes, parameters, caps, compilers, many joints."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from kinqp.codegen import CompiledStep, compile_step
from kinqp.control import make_step
from kinqp.formulations import InputError, Mode
from kinqp.robots import Robot, load_robot
from kinqp.solvers import Status
from kinqp.solvers.native import CompilerError
from tests.codegen.compiled import FORMULATIONS, REFERENCE_SOLVER, SPEEDS, Everything, compiled, near, ticks
from tests.codegen.test_parity import check_safe
from tests.formulations.reference import bounds_at, rows_at
from tests.robots.arms import arm

Array = NDArray[np.float64]
Q = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
V = np.array([0.1, 0.0, -0.05])


def lbr(formulation: str = "cartesian-error") -> CompiledStep:
    return compiled("lbr_med14", formulation, "fix-orientation")


def capped(formulation: str, cap: int, *, feasible: bool) -> CompiledStep:
    return compiled("lbr_med14", formulation, "fix-orientation", feasible=feasible, max_iterations=cap)


def everything() -> CompiledStep:
    return compiled("ur5e", "everything", "fix-orientation", quick=True)


def hard_ticks(count: int, seed: int = 0) -> list[tuple[Array, Array]]:
    """Fast commands close to limits, so that several rows hold back."""
    robot, rng = arm("lbr_med14"), np.random.default_rng(seed)
    return [(near(robot.q_min, robot.q_max, rng), 2.0 * rng.normal(size=3)) for _ in range(count)]


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


@pytest.mark.parametrize(
    ("q", "v", "message"),
    [
        (Q, [0.1, np.nan, 0.0], "v: expected finite numbers"),
        (Q, [0.1, np.inf, 0.0], "v: expected finite numbers"),
        (Q, np.zeros(6), r"v: expected shape \(3,\) for mode fix-orientation \(rows vx, vy, vz\), got shape \(6,\)"),
        (Q, 0.1, r"v: expected shape \(3,\)"),
        (Q[:6], V, r"q: expected shape \(7,\) .* got shape \(6,\)"),
        (Q[:, None], V, r"q: expected shape \(7,\) .* got shape \(7, 1\)"),
        (np.full(7, -np.inf), V, "q: expected finite numbers"),
        ("home", V, "q: expected shape"),
    ],
)
def test_mistakes_are_named(q: object, v: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        lbr()(q, v)  # type: ignore[arg-type]  # that is the point


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"qd_maximum": 1.0}, r"qd_maximum: expected an input among .*qd_max.*, got 'qd_maximum'"),
        ({"qd_max": np.ones(6)}, r"qd_max: expected shape \(7,\)"),
        ({"qd_max": -1.0}, "qd_max: expected numbers above 0"),
        ({"qd_max": np.inf}, "qd_max: expected finite numbers"),
        ({"dt": np.nan}, "dt: expected finite numbers"),
        ({"q_max": np.nan}, "q_max: expected finite numbers"),
        ({"q_min": 1.0, "q_max": 0.5}, "q_min and q_max: expected q_min <= q_max at every joint"),
        ({"q_max": -3.5}, "q_min and q_max: expected q_min <= q_max at every joint"),
    ],
)
def test_mistakes_in_parameters_are_named_and_change_nothing(inputs: dict[str, object], message: str) -> None:
    step, before = lbr(), lbr()(Q, V)
    for call in (lambda: step(Q, V, qdd_max=1.0, **inputs), lambda: step.batch([Q], [V], qdd_max=1.0, **inputs)):
        with pytest.raises(InputError, match=message):
            call()
    assert step(Q, V).qd.tobytes() == before.qd.tobytes()


def test_q_and_v_are_not_taken_twice() -> None:
    with pytest.raises(InputError, match="q: expected an input among"):
        lbr().batch([Q], [V], q=Q)


@pytest.mark.parametrize(
    ("Q_given", "V_given", "message"),
    [
        (np.zeros((3, 6)), np.zeros((3, 3)), r"Q: expected shape \(3, 7\), got \(3, 6\)"),
        (np.zeros((3, 7)), np.zeros((2, 3)), r"V: expected shape \(3, 3\), got \(2, 3\)"),
        (np.zeros((3, 7)), np.zeros((3, 6)), r"V: expected shape \(3, 3\), got \(3, 6\)"),
        (np.zeros(7), np.zeros((7, 3)), r"Q: expected shape \(7, 7\), got \(7,\)"),
    ],
)
def test_batches_of_the_wrong_shape_are_refused(Q_given: Array, V_given: Array, message: str) -> None:
    with pytest.raises(InputError, match=message):
        lbr().batch(Q_given, V_given)


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


def test_parameters_hold_for_one_call() -> None:
    step = lbr()
    free = step(Q, V)
    slowest = 0.5 * float(np.abs(free.qd).max())
    held = step(Q, V, qd_max=slowest)
    assert held.status is Status.SOLVED
    assert np.abs(held.qd).max() <= slowest + 1e-9
    assert any(name.startswith("joint limits[") for name in held.active)
    assert step(Q, V).qd.tobytes() == free.qd.tobytes()
    many = step.batch([Q, Q], [V, V], qd_max=slowest)
    assert many.qd[1].tobytes() == held.qd.tobytes()
    assert step.batch([Q], [V]).qd[0].tobytes() == free.qd.tobytes()


def test_every_parameter_reaches_the_c_code() -> None:
    reference = make_step(arm("lbr_med14"), "cartesian-error", "fix-orientation", REFERENCE_SOLVER)
    rng = np.random.default_rng(8)
    q = Q + 0.05
    changes: dict[str, ArrayLike] = {
        "dt": 2e-3,
        "q_min": q - 1e-4,
        "q_max": q + 1e-4,
        "qd_max": rng.uniform(0.1, 0.4, 7),
        "qdd_max": 0.2,
        "task_weight": [1.0, 30.0, 0.2],
        "damping_threshold": 0.5,
        "damping_max": 0.3,
        "v_fixed": [0.01, -0.02, 0.005],
    }
    step = lbr()
    assert set(changes) == set(step.inputs)
    for name, value in changes.items():
        # How much damping there is at most only matters where there is some.
        others: dict[str, ArrayLike] = {"damping_threshold": 0.5} if name == "damping_max" else {}
        result = step(q, 8 * V, **others, **{name: value})
        wanted = reference(q, 8 * V, **others, **{name: value})
        assert result.status is wanted.status is Status.SOLVED
        np.testing.assert_allclose(result.qd, wanted.qd, rtol=0, atol=1e-9, err_msg=name)
        if name != "dt":  # here no limit is near enough for the period to matter
            assert np.abs(result.qd - step(q, 8 * V, **others).qd).max() > 1e-6, name


def test_a_batch_takes_a_row_for_each_tick_of_what_is_new_at_every_tick() -> None:
    rng = np.random.default_rng(12)
    Qs, Vs, drifts = Q + 0.1 * rng.normal(size=(5, 7)), 0.1 * rng.normal(size=(5, 3)), 0.01 * rng.normal(size=(5, 3))
    result = lbr().batch(Qs, Vs, v_fixed=drifts, qd_max=0.5)
    for i in range(5):
        assert result.qd[i].tobytes() == lbr()(Qs[i], Vs[i], v_fixed=drifts[i], qd_max=0.5).qd.tobytes()
    assert lbr().batch(Qs, Vs).qd.tobytes() == lbr().batch(Qs, Vs, v_fixed=np.zeros((5, 3))).qd.tobytes()
    for bad in (np.zeros(3), np.zeros((4, 3)), np.zeros((5, 2)), 0.0):
        with pytest.raises(InputError, match=r"v_fixed: expected shape \(5, 3\), one row for each tick, got"):
            lbr().batch(Qs, Vs, v_fixed=bad)
    with pytest.raises(InputError, match=r"v_fixed: expected shape \(5, 3\), got 'none'"):
        lbr().batch(Qs, Vs, v_fixed="none")
    drifts[2, 1] = np.nan
    assert [status is Status.FAILED for status in lbr().batch(Qs, Vs, v_fixed=drifts).status] == [
        i == 2 for i in range(5)
    ]


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_drift_correction_moves_the_locked_rows(formulation: str) -> None:
    drift = np.array([0.0, 0.01, -0.005])
    result = lbr(formulation)(Q, V, v_fixed=drift)
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(arm("lbr_med14").jacobian(Q)[3:] @ result.qd, drift, atol=1e-9)
    assert not lbr(formulation)(Q, np.zeros(3)).qd.any()


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_no_locked_rows_take_an_empty_drift(formulation: str) -> None:
    step = compiled("lbr_med14", formulation, "free", quick=True)
    v = np.concatenate([V, V])
    wanted = step(Q, v).qd
    if "v_fixed" in step.inputs:
        assert step(Q, v, v_fixed=[]).qd.tobytes() == wanted.tobytes()
        with pytest.raises(InputError, match="v_fixed: expected shape"):
            step(Q, v, v_fixed=np.zeros(3))


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_capped_tick_of_a_feasible_step_is_admissible(formulation: str) -> None:
    robot = arm("lbr_med14")
    unlimited = lbr(formulation)
    stopped = improved = 0
    for cap in range(9):
        step = capped(formulation, cap, feasible=True)
        for q, v in hard_ticks(60, seed=cap):
            result = step(q, v)
            case = f"cap {cap}, q={q!r}, v={v!r}"
            assert result.status in (Status.SOLVED, Status.MAX_ITERATIONS), case
            assert result.iterations <= cap, case
            check_safe(step, result, q, case)
            low, high = bounds_at(robot, q)
            assert (result.qd >= low - 1e-9).all(), case
            assert (result.qd <= high + 1e-9).all(), case
            free, _ = rows_at(robot, step.mode, q)
            np.testing.assert_allclose(free @ result.qd - v, result.eps, rtol=0, atol=1e-9)
            if result.status is Status.MAX_ITERATIONS:
                stopped += 1
                # Never worse than standing still, which is where it starts.
                effort = 1e-4 * result.qd @ result.qd if formulation == "joint-space" else 0.0
                cost = 0.5 * (result.eps @ result.eps + effort)
                assert cost <= 0.5 * v @ v + 1e-9, case
                improved += bool(result.qd.any())
            else:
                wanted = unlimited(q, v)
                assert np.abs(result.qd - wanted.qd).max() <= 1e-7 * max(1.0, np.abs(wanted.qd).max()), case
    assert stopped > 60
    assert improved > 10


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_capped_tick_stops_otherwise(formulation: str) -> None:
    stopped = 0
    for cap in (0, 1, 3):
        step = capped(formulation, cap, feasible=False)
        for q, v in hard_ticks(60):
            result = step(q, v)
            assert result.status in (Status.SOLVED, Status.MAX_ITERATIONS)
            if result.status is Status.MAX_ITERATIONS:
                assert not result.qd.any()
                np.testing.assert_array_equal(result.eps, -v)
                stopped += 1
    assert stopped > 30


def test_a_capped_tick_with_drift_never_leaves_the_bounds() -> None:
    """With drift correction the declared point may be out of bounds: then it is no start."""
    for formulation in FORMULATIONS:
        for cap in (0, 1, 4):
            step = capped(formulation, cap, feasible=True)
            for q, v in hard_ticks(40, seed=11):
                result = step(q, v, v_fixed=[0.3, -0.2, 0.4])
                low, high = bounds_at(arm("lbr_med14"), q)
                assert (result.qd >= low - 1e-9).all()
                assert (result.qd <= high + 1e-9).all()


def test_a_cap_that_is_no_count_is_refused() -> None:
    with pytest.raises(ValueError, match="max_iterations: expected a count that is not negative, got -1"):
        compile_step(arm("lbr_med14"), "cartesian-error", "fix-orientation", max_iterations=-1)


def test_solvers_without_c_are_refused() -> None:
    with pytest.raises(ValueError, match=r"solver: .* \(active-set, casadi-qrqp\), got 'clarabel'; see make_step"):
        compile_step(arm("lbr_med14"), "cartesian-error", "fix-orientation", "clarabel")


def test_a_formulation_of_ones_own() -> None:
    """A gradient, rows besides the box, inputs without defaults, a command with an offset, no feasible point."""
    step, reference = everything(), make_step(arm("ur5e"), Everything(), "fix-orientation", REFERENCE_SOLVER)
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
    assert seen == {"slack", "difference", "joint limits"}


def test_inputs_without_defaults_are_asked_for() -> None:
    step = everything()
    q, v = np.zeros(6), np.zeros(3)
    with pytest.raises(InputError, match=r"qd_wish: expected shape \(6,\), got nothing"):
        step(q, v, qd_prev=np.zeros(6))
    with pytest.raises(InputError, match=r"qd_prev: expected shape \(6,\), got nothing"):
        step(q, v, qd_wish=np.zeros(6))
    with pytest.raises(InputError, match=r"qd_prev: expected shape \(1, 6\), got nothing"):
        step.batch([q], [v], qd_wish=np.zeros(6))
    with pytest.raises(InputError, match=r"qd_wish: expected shape \(6,\), got nothing"):
        step.batch([q], [v], qd_prev=np.zeros((1, 6)))


def test_a_capped_tick_without_a_declared_point_stops() -> None:
    """`feasible` has nothing to start from there: the minimiser without rows must not be sent instead."""
    step = compiled("ur5e", "everything", "fix-orientation", quick=True, feasible=True, max_iterations=0)
    rng = np.random.default_rng(6)
    stopped = 0
    for _, q, v in ticks("ur5e", "fix-orientation", 24):
        result = step(q, v, qd_wish=5.0 * rng.normal(size=6), qd_prev=np.zeros(6))
        if result.status is Status.MAX_ITERATIONS:
            assert not result.qd.any()
            stopped += 1
    assert stopped > 5


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
