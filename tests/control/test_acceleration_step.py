"""Acceleration level, one cycle after the other: what must hold of every command, the safe stop, the closed loop."""

from __future__ import annotations

from collections import Counter
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinqp.benchmarks import Scenario, get_scenario
from kinqp.control import BOUND_TOLERANCE, InterpretedStep, Trajectory, make_step, simulate
from kinqp.formulations import InputError, Mode, get_formulation
from kinqp.robots import load_robot
from kinqp.solvers import QP, RawSolution, Solver, Status, get_solver
from tests.control.states import states
from tests.formulations.acceleration_level import MODES, NAMES
from tests.formulations.reference import bounds_at, rows_at
from tests.robots.arms import arm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Interior-point solvers lose digits where locked rows become dependent, near q = 0, as at velocity level.
LEAST_SOLVED = {"active-set": 1.0, "clarabel": 0.9, "piqp": 0.85}


def check_invariants(name: str, solver: str, robot_name: str, modes: tuple[str, ...], count: int) -> None:
    robot, outcome = arm(robot_name), Counter[bool]()
    for text in modes:
        mode = Mode.parse(text)
        step, rng = make_step(robot, name, mode, solver), np.random.default_rng(1)
        for kind, q in states(robot, count):
            v = rng.normal(size=mode.m_free) * rng.choice([1e-6, 0.01, 0.2, 2.0])
            # Whatever locked rows and limits say of it, from rest to twice as fast as the arm may be.
            qd = rng.uniform(-1.0, 1.0, robot.nv) * robot.qd_max * rng.choice([0.0, 1e-3, 0.1, 1.0, 2.0])
            result = step(q, v, qd_prev=qd)
            outcome[result.status is Status.SOLVED] += 1
            case = f"{text}, {kind}, q={q!r}, qd_prev={qd!r}, v={v!r}: {result.message}"
            low, high = bounds_at(robot, q)
            # Bounds hold for the safe stop as well.
            assert (result.qd <= high + BOUND_TOLERANCE).all(), case
            assert (result.qd >= low - BOUND_TOLERANCE).all(), case
            J_free, J_fixed = rows_at(robot, mode, q)
            np.testing.assert_allclose(J_free @ result.qd - v, result.eps, rtol=0, atol=1e-9)
            if result.status is Status.SOLVED:
                share = np.abs(J_fixed) @ np.abs(result.qd)
                assert (np.abs(J_fixed @ result.qd) <= 2e-9 * np.maximum(share, 1.0)).all(), case
    assert outcome[True] >= LEAST_SOLVED[solver] * outcome.total()


QUICK = [
    *((name, "active-set", "lbr_med14", ("free", "fix-orientation", "line:z")) for name in NAMES),
    ("joint-space-acceleration", "clarabel", "panda", ("rcm:0.1",)),
    ("joint-space-acceleration", "piqp", "ur5e", ("plane:0,0,1",)),
    ("cartesian-error-acceleration", "clarabel", "ur5e", ("fix-position",)),
    ("cartesian-error-acceleration", "piqp", "panda", ("position",)),
    ("minimum-acceleration-norm", "piqp", "panda", ("fix-position",)),
    ("minimum-torque-norm", "clarabel", "ur5e", ("rcm:0.1",)),
]


@pytest.mark.parametrize(("name", "solver", "robot", "modes"), QUICK)
def test_every_command_is_safe(name: str, solver: str, robot: str, modes: tuple[str, ...]) -> None:
    check_invariants(name, solver, robot, modes, 24)


@pytest.mark.long
@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e", "panda"])
@pytest.mark.parametrize("solver", LEAST_SOLVED)
@pytest.mark.parametrize("name", NAMES)
def test_every_command_is_safe_on_many_states(name: str, solver: str, robot: str) -> None:
    check_invariants(name, solver, robot, MODES, 1200)


class GivesUp(Solver):
    """Solves like the active set, but for ticks that it is told to give up on."""

    name = "gives-up"

    def __init__(self, first: int) -> None:
        super().__init__(tolerance=1e-9)
        self.inner = get_solver("active-set")
        self.left = first

    def _setup(self, qp: QP) -> None:
        pass

    def _update(self, qp: QP) -> None:
        pass

    def _solve(self, qp: QP) -> RawSolution:
        self.left -= 1
        if self.left < 0:
            nothing = {"y": np.zeros(qp.m_eq), "z": np.zeros(qp.m_ineq), "z_box": np.zeros(qp.n)}
            return RawSolution(claimed=Status.MAX_ITERATIONS, x=np.zeros(qp.n), **nothing, message="told to")
        answer = self.inner.solve(qp)
        return RawSolution(claimed=answer.status, x=answer.x, y=answer.y, z=answer.z, z_box=answer.z_box, message="")


Q = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])


class Pull:
    """A steady hand."""

    def twist(self, t: float, pose: Array) -> Array:  # noqa: ARG002  # the interface's arguments
        return np.array([0.3, 0.0, -0.2, 0.0, 0.0, 0.0])


def stopping(name: str, solver: Solver) -> Trajectory:
    robot = load_robot("lbr_med14")
    step = InterpretedStep(robot, get_formulation(name), Mode.fix_orientation(), solver)
    return simulate(step, Pull(), Q, 0.4)


def test_a_solver_that_gives_up_brakes_the_robot() -> None:
    run = stopping("joint-space-acceleration", GivesUp(100))
    robot = load_robot("lbr_med14")
    assert [status is Status.SOLVED for status in run.status] == [tick < 100 for tick in range(400)]
    acceleration = run.acceleration()
    assert np.abs(acceleration).max() <= 10.0 * (1.0 + 1e-9)
    # The fastest joint decides, and brakes as hard as it may; the direction in joint space stays.
    fastest = np.abs(run.qd[99]).max()
    ticks = int(np.ceil(fastest / 0.01))
    assert ticks > 20
    assert np.abs(run.qd[99 + ticks - 1]).max() > 0.0
    assert not run.qd[99 + ticks :].any()
    np.testing.assert_allclose(run.qd[110] / np.linalg.norm(run.qd[110]), run.qd[99] / np.linalg.norm(run.qd[99]))
    # So the locked rows are left slowly only, by how the arm turns meanwhile.
    _, locked = rows_at(robot, Mode.fix_orientation(), run.q[110])
    assert np.abs(locked @ run.qd[110]).max() < 0.01 * np.abs(run.qd[110]).max()
    assert all("told to" in message for message in run.message[100:])


def test_at_velocity_level_the_safe_stop_is_zero_at_once() -> None:
    run = stopping("joint-space", GivesUp(100))
    assert run.qd[99].any()
    assert not run.qd[100:].any()


@pytest.mark.parametrize("missing", [{}, {"qd_prev": np.zeros(6)}, {"qd_prev": np.full(7, np.nan)}])
def test_the_last_command_is_asked_for(missing: dict[str, Array]) -> None:
    step = make_step(load_robot("lbr_med14"), "joint-space-acceleration", "fix-orientation")
    with pytest.raises(InputError, match=r"^qd_prev: expected "):
        step(Q, np.zeros(3), **missing)


def test_drift_correction_moves_the_locked_rows() -> None:
    robot, drift = load_robot("lbr_med14"), np.array([0.0, 0.01, -0.005])
    for name in NAMES:
        step = make_step(robot, name, "fix-orientation", "active-set")
        result = step(Q, np.zeros(3), qd_prev=np.zeros(7), v_fixed=drift)
        assert result.status is Status.SOLVED, name
        np.testing.assert_allclose(robot.jacobian(Q)[3:] @ result.qd, drift, atol=1e-12)


ELBOW = 3


@cache
def scenario() -> Scenario:
    return get_scenario("semicircle")


@cache
def run(name: str, solver: str) -> Trajectory:
    s = scenario()
    return simulate(make_step(s.robot, name, s.mode, solver), s.guide, s.q0, s.duration, dt=s.dt)


def check_run(name: str, solver: str) -> None:
    trajectory, robot = run(name, solver), scenario().robot
    assert set(trajectory.status) == {Status.SOLVED}
    peak = np.abs(trajectory.acceleration()) / robot.qdd_max
    assert peak.max() <= 1.0 + 1e-6
    assert peak[:, ELBOW].max() >= 0.99, "the elbow brakes as hard as it may, and no earlier"
    assert trajectory.fixed_error.max() <= 1e-9
    q = np.vstack((trajectory.q, trajectory.q_end))
    assert (q <= robot.q_max + 4.5e-16).all()
    assert (q >= robot.q_min - 4.5e-16).all()
    assert (q[:, ELBOW] - robot.q_min[ELBOW]).min() <= 1e-6
    turn = robot.pose(trajectory.q[0])[:3, :3].T @ robot.pose(trajectory.q_end)[:3, :3]
    assert np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)) < 5e-3


@pytest.mark.parametrize("name", NAMES)
def test_semicircle_within_acceleration_limits(name: str) -> None:
    check_run(name, "active-set")


@pytest.mark.long
@pytest.mark.parametrize("solver", ["clarabel", "piqp"])
@pytest.mark.parametrize("name", NAMES)
def test_semicircle_with_interior_points(name: str, solver: str) -> None:
    check_run(name, solver)
    np.testing.assert_allclose(run(name, solver).q_end, run(name, "active-set").q_end, rtol=0, atol=1e-3)


@pytest.mark.parametrize("name", NAMES[:2])
def test_error_based_ones_slide_along_the_limit_to_the_end(name: str) -> None:
    trajectory, s = run(name, "active-set"), scenario()
    on_limit = trajectory.q[:, ELBOW] - s.robot.q_min[ELBOW] <= 1e-6
    assert 0.3 < on_limit.mean() < 0.35
    assert not on_limit[-1]
    # At the end of the path, but for the lag.
    assert np.linalg.norm(trajectory.v[-1]) < 5e-3
    assert np.linalg.norm(trajectory.eps[-1]) < 5e-3


@pytest.mark.parametrize("name", NAMES[2:])
def test_scaled_ones_stop_at_the_limit(name: str) -> None:
    """Recorded as such: a task that keeps its direction can't slide, and the hand ends far ahead of the arm."""
    trajectory = run(name, "active-set")
    on_limit = trajectory.q[:, ELBOW] - scenario().robot.q_min[ELBOW] <= 1e-6
    assert on_limit[-1]
    assert on_limit.mean() > 0.5
    assert np.linalg.norm(trajectory.eps[-1]) > 0.3


def test_minimum_torques_throw_the_arm_about() -> None:
    """Hollerbach and Suh's instability: joints that are slow where self-motion is damped meet their limits here."""
    s = scenario()
    share = np.abs(run("minimum-torque-norm", "active-set").qd) / s.robot.qd_max
    assert share.max() > 0.99
    assert (np.abs(run("joint-space-acceleration", "active-set").qd) / s.robot.qd_max).max() < 0.4
