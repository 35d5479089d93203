"""`hierarchical` against the thesis's formula, SciPy's bounded least squares, and as a cascade of any levels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from kinqp.codegen import compile_step, export_c
from kinqp.control import make_step, simulate
from kinqp.formulations import (
    DeclarationError,
    Formulation,
    Hierarchical,
    Hierarchy,
    InputError,
    Mode,
    command_above,
    get_formulation,
    levels_of,
    lower,
)
from kinqp.formulations.cvxpy_cascade import CvxpyCascade
from kinqp.robots import load_robot
from kinqp.solvers import QP, RawSolution, Solver, Status
from tests.formulations.reference import adversarial_state, bounds_at, null_projector, rows_at
from tests.robots.arms import arm

if TYPE_CHECKING:
    from pathlib import Path

    from kinqp.formulations import QuadraticProgram, Tick
    from tests.formulations.reference import Array

ROBOT = load_robot("lbr_med14")
NO_LIMITS = {"q_min": -np.inf, "q_max": np.inf, "qd_max": 1e3}
Q = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
V = np.array([0.1, 0.0, -0.05])


@pytest.mark.parametrize("mode", ["free", "position", "fix-orientation", "line:z", "rcm:0.1"])
def test_without_limits_it_is_task_priority(mode: str) -> None:
    """Eq. 3.2, three tasks: mode, hand, posture."""
    read, rng = Mode.parse(mode), np.random.default_rng(1)
    step = make_step(ROBOT, "hierarchical", read)
    compared = 0
    for _ in range(20):
        q, v = ROBOT.random_configuration(rng), 0.3 * rng.normal(size=read.m_free)
        drift, posture, gain = 0.02 * rng.normal(size=read.m_fixed), rng.normal(size=7), rng.choice([0.0, 2.0])
        J_free, J_fixed = rows_at(ROBOT, read, q)
        N = null_projector(J_fixed)
        if np.linalg.svd(J_free @ N, compute_uv=False)[-1] < 0.02:
            continue
        one = np.linalg.pinv(J_fixed) @ drift if read.m_fixed else np.zeros(7)
        two = one + np.linalg.pinv(J_free @ N, rcond=1e-9) @ (v - J_free @ one)
        wanted = two + null_projector(np.vstack((J_fixed, J_free))) @ (gain * (posture - q) - two)
        result = step(q, v, v_fixed=drift, posture=posture, posture_gain=gain, **NO_LIMITS)
        assert result.status is Status.SOLVED, result.message
        np.testing.assert_allclose(result.qd, wanted, rtol=0, atol=1e-8 * max(1.0, np.abs(wanted).max()))
        compared += 1
    assert compared > 10


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "panda"])
@pytest.mark.parametrize("mode", ["position", "free"])
def test_at_limits_the_task_comes_first(mode: str, name: str) -> None:
    """The Cartesian error is that of SciPy's bounded least squares, and no posture, however wanted, makes it larger."""
    robot, read, rng = arm(name), Mode.parse(mode), np.random.default_rng(2)
    step = make_step(robot, "hierarchical", read)
    hindered = moved = unsolved = 0
    for _ in range(25):
        q, v = adversarial_state(robot, rng), rng.normal(size=read.m_free)
        J_free, _ = rows_at(robot, read, q)
        low, high = bounds_at(robot, q)
        inside = high - low > 1e-9  # SciPy wants an interior
        best = lsq_linear(J_free[:, inside], v, (low[inside], high[inside]), method="bvls", tol=1e-14, max_iter=1000)
        plain, pulled = step(q, v), step(q, v, posture_gain=50.0)
        for result in (plain, pulled):
            unsolved += result.status is not Status.SOLVED
            if result.status is not Status.SOLVED:
                assert not result.qd.any()
                continue
            np.testing.assert_allclose(result.eps, best.fun, rtol=0, atol=1e-7)
        hindered += np.linalg.norm(plain.eps) > 1e-3
        moved += np.abs(plain.qd - pulled.qd).max() > 1e-3
    assert hindered > 10
    # Singular to 1e-11 with joints on their limits, the solver may give up on a level.
    assert unsolved <= 3
    assert mode == "free" or moved > 10


@pytest.mark.parametrize("mode", ["fix-orientation", "position"])
def test_it_is_where_joint_space_tends_to(mode: str) -> None:
    """A joint weight mu costs the share mu / sigma^2 of the task: here 1e-9 on singular values above 0.1."""
    read, rng = Mode.parse(mode), np.random.default_rng(3)
    step, limit = make_step(ROBOT, "hierarchical", read), make_step(ROBOT, "joint-space", read)
    held = 0
    for _ in range(25):
        q = np.clip(1.2 * ROBOT.random_configuration(rng), ROBOT.q_min, ROBOT.q_max)
        J_free, J_fixed = rows_at(ROBOT, read, q)
        if np.linalg.svd(J_free @ null_projector(J_fixed), compute_uv=False)[-1] < 0.1:
            continue
        v = 0.2 * rng.normal(size=3)
        one, two = step(q, v), limit(q, v, joint_weight=1e-9)
        assert one.status is two.status is Status.SOLVED
        assert np.linalg.norm(one.eps) <= np.linalg.norm(two.eps) + 1e-9
        np.testing.assert_allclose(one.qd, two.qd, atol=1e-4)
        held += bool(one.active)
    assert held > 5


def test_the_arm_rests_when_the_hand_does() -> None:
    step, rng = make_step(ROBOT, "hierarchical", "fix-orientation"), np.random.default_rng(4)
    for _ in range(20):
        q = adversarial_state(ROBOT, rng)
        np.testing.assert_allclose(step(q, np.zeros(3)).qd, 0.0, atol=1e-9)
    pulled = step(Q, np.zeros(3), posture_gain=1.0)
    np.testing.assert_allclose(ROBOT.jacobian(Q) @ pulled.qd, 0.0, atol=1e-9)
    # The middle of the LBR's ranges is zero, and a projection p of a vector a has p'a = p'p.
    assert pulled.qd @ (0.0 - Q) == pytest.approx(pulled.qd @ pulled.qd, rel=1e-6)
    assert np.linalg.norm(pulled.qd) > 0.05


class Pulling:
    """A hand that pulls steadily [m/s]."""

    def twist(self, t: float, pose: Array) -> Array:
        return np.array([0.05, 0.05 * np.cos(t) * pose[3, 3], 0.0, 0.0, 0.0, 0.0])


def test_in_closed_loop_the_posture_is_taken_without_disturbing_the_hand() -> None:
    step = make_step(ROBOT, "hierarchical", "fix-orientation")
    run = simulate(step, Pulling(), Q, 0.4)
    assert all(status is Status.SOLVED for status in run.status)
    assert np.abs(run.eps).max() < 1e-8
    assert run.fixed_error.max() < 1e-12


def test_inputs_are_those_of_all_levels() -> None:
    step = make_step(ROBOT, "hierarchical", "fix-orientation")
    assert {"task_weight", "joint_weight", "posture", "posture_gain", "qd_max", "v_fixed"} <= set(step.inputs)
    assert "qd_above" not in step.inputs
    for bad in ("qd_above", "speed"):
        with pytest.raises(InputError, match=f"{bad}: expected an input among q, .*posture.*, got '{bad}'"):
            step(Q, V, **{bad: 1.0})
    assert step(Q, V).status is Status.SOLVED
    with pytest.raises(InputError, match=r"posture: expected shape \(7,\)"):
        step(Q, V, posture=np.zeros(6))
    assert step.evaluate(Q, V).qp.n == 7


class Failing(Solver):
    """Answers as many problems with zero as it is told, and fails the next."""

    name = "failing"

    def __init__(self, good: int) -> None:
        super().__init__(tolerance=1e-9)
        self.good = good

    def _setup(self, qp: QP) -> None:
        self.n, self.p, self.m = qp.n, qp.m_eq, qp.m_ineq

    def _update(self, qp: QP) -> None:
        self._setup(qp)

    def _solve(self, qp: QP) -> RawSolution:
        self.good -= 1
        claimed = Status.SOLVED if self.good >= 0 else Status.MAX_ITERATIONS
        zero = np.zeros(self.n)
        return RawSolution(
            claimed=claimed, x=zero, y=np.zeros(self.p), z=np.zeros(self.m), z_box=np.zeros(qp.n), message="gave up"
        )


@pytest.mark.parametrize(("good", "level"), [(0, "task"), (1, "posture")])
def test_a_level_that_fails_stops_the_robot(good: int, level: str) -> None:
    step = make_step(ROBOT, "hierarchical", "fix-orientation", Failing(good))
    result = step(Q, np.zeros(3))
    assert result.status is Status.MAX_ITERATIONS
    assert not result.qd.any()
    assert result.active == ()
    assert result.message == f"{level}: gave up"
    assert make_step(ROBOT, "hierarchical", "fix-orientation", Failing(2))(Q, np.zeros(3)).status is Status.SOLVED


SENTENCE = (
    r"hierarchical: expected a formulation of one QP, got 2 to solve in order \(task > posture\); make_step does that"
)


def test_it_is_not_taken_for_one_qp(tmp_path: Path) -> None:
    for call in (
        lambda: lower(Hierarchical(), ROBOT, Mode.free()),
        lambda: compile_step(ROBOT, "hierarchical", "free"),
        lambda: export_c(ROBOT, "hierarchical", "free", tmp_path / "out"),
    ):
        with pytest.raises(DeclarationError, match=SENTENCE):
            call()
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e"])
def test_in_cvxpy_it_is_the_same_cascade(name: str) -> None:
    """Level by level with another modeller and another solver, on random states and in limits."""
    robot, rng = arm(name), np.random.default_rng(5)
    written = Hierarchical().to_cvxpy(robot, "fix-orientation")
    step = make_step(robot, "hierarchical", "fix-orientation")
    assert isinstance(written, CvxpyCascade)
    assert set(written.inputs) == {"q", "v", *step.inputs}
    compared = held = 0
    for _ in range(12):
        q, v = robot.random_configuration(rng), rng.normal(size=3) * rng.choice([0.02, 0.5])
        wanted = step(q, v, posture_gain=0.5)
        if wanted.sigma_min < 0.05 or wanted.status is not Status.SOLVED:
            continue
        qd = written.solve("CLARABEL", q=q, v=v, posture_gain=0.5)
        np.testing.assert_allclose(qd, wanted.qd, rtol=0, atol=2e-5)
        compared += 1
        held += bool(wanted.active)
    assert all(level.problem.is_dpp() for level in written.levels)
    assert compared >= 5
    assert held >= 2
    with pytest.raises(InputError, match="qd_above: expected an input among q"):
        written.solve("CLARABEL", q=q, v=v, qd_above=np.zeros(robot.nv))


def test_it_describes_all_levels_in_order() -> None:
    text = Hierarchical().describe(ROBOT, "fix-orientation")
    assert text.startswith("# `hierarchical` on `lbr_med14`, mode `fix-orientation`\n\nMode and limits always")
    assert "2 QPs, solved in order: task > posture." in text
    assert text.index("## Level `task`") < text.index("## Level `posture`")
    assert text.count("```math") == text.count("### Dimensions") == text.count("### Run-time inputs") == 2
    assert "| `qd_above` | 7 | rad/s or m/s | to be given at every tick |" in text.partition("## Level `posture`")[2]


def test_levels_take_the_options() -> None:
    made = get_formulation("hierarchical(bounds=thesis)")
    assert [level.bounds for level in levels_of(made)] == ["thesis", "thesis"]
    assert levels_of(get_formulation("joint-space")) == (get_formulation("joint-space"),)


@dataclass(frozen=True)
class HoldJoint(Formulation):
    """Keep one joint still as far as the task's rows allow; hand on what is decided."""

    joint: int = 0

    name: ClassVar[str] = "hold"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        z, above = qp.variable("z", tick.nv), command_above(tick)
        qp.minimize((above + z)[self.joint], name="joint")
        qp.minimize(z, weight=1e-6)
        qp.equal(tick.J @ z, 0, name="twist")
        qp.between(tick.qd_lo - above, z, tick.qd_hi - above, name="joint limits")
        qp.command(above + z)


@dataclass(frozen=True)
class ThreeLevels(Hierarchy):
    """The two of `hierarchical`, and a joint that is held."""

    name: ClassVar[str] = "three-levels"

    @property
    def levels(self) -> tuple[Formulation, ...]:
        return *Hierarchical(self.bounds).levels, HoldJoint(self.bounds, 2)


def test_any_number_of_levels() -> None:
    two, three = (make_step(ROBOT, made, "fix-orientation") for made in (Hierarchical(), ThreeLevels()))
    before, after = two(Q, V), three(Q, V)
    assert abs(before.qd[2]) > 1e-3
    assert abs(after.qd[2]) < 1e-5
    np.testing.assert_allclose(ROBOT.jacobian(Q) @ after.qd, ROBOT.jacobian(Q) @ before.qd, atol=1e-9)
