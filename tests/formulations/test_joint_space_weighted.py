"""`joint-space-weighted`: Chan and Dubey's gradient, weighted least norm, and what asking the command is good for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np
import pytest

from kinqp.control import make_step, simulate
from kinqp.formulations import DEFAULT_JOINT_WEIGHT, Formulation, Mode, limit_gradient
from kinqp.robots import load_robot
from kinqp.solvers import Status
from tests.finite_differences import difference_jacobian
from tests.formulations.reference import adversarial_state, rows_at
from tests.robots.arms import arm

if TYPE_CHECKING:
    from kinqp.control import Trajectory
    from kinqp.formulations import QuadraticProgram, Tick
    from tests.formulations.reference import Array

ROBOT = load_robot("lbr_med14")
W_MAX = 100.0


def gradient(q: Array, q_min: Array, q_max: Array) -> Array:
    return np.array(ca.evalf(limit_gradient(ca.SX(q), ca.SX(q_min), ca.SX(q_max))))[:, 0]


def test_gradient_by_hand() -> None:
    """A range of 2: at 0.5, (2^2 * (2*0.5)) / (4 * 0.5^2 * 1.5^2) = 16/9."""
    q = np.array([0.0, 0.5, -0.5, 0.9])
    got = gradient(q, -np.ones(4), np.ones(4))
    np.testing.assert_allclose(got, [0.0, 16 / 9, -16 / 9, 4 * 1.8 / (4 * 0.1**2 * 1.9**2)], rtol=1e-14)


def test_gradient_is_that_of_the_criterion() -> None:
    low, high = ROBOT.q_min, ROBOT.q_max

    def criterion(q: Array) -> Array:
        return np.array([np.sum((high - low) ** 2 / (4.0 * (high - q) * (q - low)))])

    rng = np.random.default_rng(1)
    for _ in range(20):
        q = low + (0.05 + 0.9 * rng.random(7)) * (high - low)
        np.testing.assert_allclose(gradient(q, low, high), difference_jacobian(criterion, q)[0], rtol=1e-6, atol=1e-6)


def test_gradient_is_finite_everywhere() -> None:
    q = np.array([1.0, -1.0, 5.0, -5.0, 1e9, 0.3, 0.3, 0.3])
    low = np.array([-1.0, -1.0, -1.0, -1.0, -1.0, -np.inf, -np.inf, -1.0])
    high = np.array([1.0, 1.0, 1.0, 1.0, 1.0, np.inf, 1.0, np.inf])
    got = gradient(q, low, high)
    assert np.isfinite(got).all()
    assert (got[[0, 2, 4]] > 1e6).all()
    assert (got[[1, 3]] < -1e6).all()
    assert got[5] == 0.0
    assert got[6] > 0.0 > got[7]


def weights(q: Array, qd: Array) -> Array:
    """Eq. 3.6 for a command: 1 + |dH/dq| for joints that it moves towards their nearer limit, 1 for the others."""
    slope = gradient(q, ROBOT.q_min, ROBOT.q_max)
    return np.where(slope * qd > 0.0, np.minimum(1.0 + np.abs(slope), W_MAX), 1.0)


@pytest.mark.parametrize("mode", ["position", "fix-orientation", "rcm:0.1"])
def test_weighted_least_norm(mode: str) -> None:
    """With the weights that its own direction asks for, the command is the weighted damped inverse's (eq. 3.5)."""
    read, rng = Mode.parse(mode), np.random.default_rng(2)
    step = make_step(ROBOT, "joint-space-weighted", read)
    weighted = 0
    for _ in range(60):
        q, v = ROBOT.random_configuration(rng), 0.02 * rng.normal(size=read.m_free)
        result = step(q, v)
        assert result.status is Status.SOLVED
        if any(name.startswith("joint limits") for name in result.active):
            continue
        J_free, J_fixed = rows_at(ROBOT, read, q)
        W = weights(q, result.qd)
        weighted += bool(np.any(W > 5.0))
        H = J_free.T @ J_free + DEFAULT_JOINT_WEIGHT * np.diag(W)
        m = len(J_fixed)
        kkt = np.block([[H, J_fixed.T], [J_fixed, np.zeros((m, m))]])
        wanted = np.linalg.solve(kkt, np.concatenate((J_free.T @ v, np.zeros(m))))[:7]
        np.testing.assert_allclose(result.qd, wanted, rtol=0, atol=1e-8)
    assert weighted > 20


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "panda"])
@pytest.mark.parametrize("mode", ["free", "fix-orientation"])
def test_without_gain_it_is_joint_space(name: str, mode: str) -> None:
    robot, read, rng = arm(name), Mode.parse(mode), np.random.default_rng(3)
    step, plain = make_step(robot, "joint-space-weighted", read), make_step(robot, "joint-space", read)
    unlike = 0
    for trial in range(20):
        q = robot.random_configuration(rng)
        if trial % 2:
            q = np.clip(1.3 * q, robot.q_min, robot.q_max)
        v = 0.5 * rng.normal(size=read.m_free)
        wanted = plain(q, v)
        result = step(q, v, limit_gain=0.0)
        np.testing.assert_allclose(result.qd, wanted.qd, atol=1e-8)
        limits = {name for name in result.active if name.startswith("joint limits")}
        assert limits == set(wanted.active)
        unlike += bool(np.abs(step(q, v).qd - wanted.qd).max() > 1e-3)
    assert unlike > 5


def test_a_joint_may_leave_its_limit_freely() -> None:
    """Near the elbow's limit the way out costs what it always did, the way in a hundred times that."""
    step, plain = make_step(ROBOT, "joint-space-weighted", "position"), make_step(ROBOT, "joint-space", "position")
    q = np.deg2rad([10.0, 30.0, 5.0, -115.0, -5.0, 60.0, 0.0])
    towards = -0.05 * ROBOT.jacobian(q)[:3, 3] / np.linalg.norm(ROBOT.jacobian(q)[:3, 3])
    assert plain(q, towards).qd[3] < -0.05
    assert abs(step(q, towards).qd[3]) < 0.2 * abs(plain(q, towards).qd[3])
    # Outwards the other joints' weights still count, which are near 1 here.
    assert step(q, -towards).qd[3] > 0.9 * plain(q, -towards).qd[3] > 0.0
    np.testing.assert_allclose(step(q, towards).eps, 0.0, atol=2e-3)


def test_a_resting_hand_is_a_resting_arm() -> None:
    rng = np.random.default_rng(4)
    step = make_step(ROBOT, "joint-space-weighted", "fix-orientation")
    for _ in range(20):
        np.testing.assert_allclose(step(adversarial_state(ROBOT, rng), np.zeros(3)).qd, 0.0, atol=1e-12)


@dataclass(frozen=True)
class AskingTheLastCommand(Formulation):
    """Eq. 3.6 to the letter."""

    name: ClassVar[str] = "asking-the-last-command"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        eps, qd = qp.variable("eps", tick.m_free), qp.variable("qd", tick.nv)
        slope = limit_gradient(tick.q, tick.q_min, tick.q_max)
        weight = ca.fmin(1 + ca.if_else(slope * tick.qd_prev >= 0, ca.fabs(slope), 0), W_MAX)
        qp.minimize(eps)
        qp.minimize(qd, weight=DEFAULT_JOINT_WEIGHT * weight)
        qp.equal(tick.J_free @ qd - eps, tick.v, name="task")
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)


class Waving:
    """A hand that moves to and fro in all directions [m/s]."""

    def twist(self, t: float, pose: Array) -> Array:  # noqa: ARG002  # a guide is asked for its twist at a pose
        speed, rate, phase = np.array([0.12, 0.1, 0.08]), np.array([0.4, 0.5, 0.3]), np.array([0.0, 1.0, 2.0])
        return np.concatenate((speed * np.sin(2.0 * np.pi * rate * t + phase), np.zeros(3)))


def waved(formulation: str | Formulation, degrees: list[float]) -> Trajectory:
    step = make_step(ROBOT, formulation, "position")
    run = simulate(step, Waving(), np.deg2rad(degrees), 3.0, dt=2e-3)
    assert all(status is Status.SOLVED for status in run.status)
    return run


def peak(run: Trajectory) -> float:
    """Largest joint acceleration over its limit."""
    return float(np.max(np.abs(np.diff(run.qd, axis=0)) / 2e-3 / ROBOT.qdd_max))


def closest(run: Trajectory) -> float:
    return float(np.min(np.minimum(ROBOT.q_max - run.q, run.q - ROBOT.q_min)))


def test_in_closed_loop_limits_are_kept_away_from() -> None:
    start = [23.0, 2.0, -78.0, -109.0, 53.0, 109.0, 19.0]
    plain, weighted = waved("joint-space", start), waved("joint-space-weighted", start)
    assert closest(plain) < 0.06
    assert closest(weighted) > 0.15
    assert np.linalg.norm(weighted.eps, axis=1).max() < 2e-3  # of 0.18 m/s
    assert peak(weighted) < 0.5


def test_asking_the_last_command_makes_joints_jump() -> None:
    """Eq. 3.6 as printed has the same effect on the limits, by jumps whenever a joint turns round."""
    start = [39.0, 35.0, 74.0, -42.0, -85.0, 103.0, -82.0]
    weighted, literal = waved("joint-space-weighted", start), waved(AskingTheLastCommand(), start)
    assert closest(weighted) == pytest.approx(closest(literal), abs=1e-3)
    assert peak(weighted) < 0.3
    assert peak(literal) > 15.0
