"""Formulations in accelerations unhindered: the velocity level, closed forms, the lag behind the hand."""

from __future__ import annotations

import numpy as np
import pytest

from kinqp.control import make_step
from kinqp.formulations import Mode
from tests.formulations.acceleration_level import NAMES, SOME_MODES, WIDE, T, admissible, command, tool_speed
from tests.formulations.reference import DT, evaluator, null_projector, rows_at
from tests.robots.arms import arm


@pytest.mark.parametrize("name", ["cartesian-error", "joint-space"])
@pytest.mark.parametrize("mode", SOME_MODES)
def test_without_lag_and_acceleration_limits_it_is_the_velocity_level(name: str, mode: str) -> None:
    for robot in ("lbr_med14", "ur5e"):
        below, above = evaluator(robot, name, mode), evaluator(robot, f"{name}-acceleration", mode)
        for q, qd, v in admissible(arm(robot), mode, 8):
            # The velocity bounds depend on qdd_max too: they are made the same by limits that are never near.
            given = {"q": q, "v": v, "q_min": -np.inf, "q_max": np.inf}
            wanted = command(below(**given))
            got = command(above(**given, qd_prev=qd, time_constant=0.0, **WIDE))
            np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-9 * max(1.0, float(np.abs(wanted).max())))


@pytest.mark.parametrize("mode", SOME_MODES)
@pytest.mark.parametrize("name", NAMES)
def test_the_tool_follows_the_hand_with_a_lag_of_first_order(name: str, mode: str) -> None:
    """J qd = x + (dt/T)(v - x): the curvature of the path cancels, and the locked rows hold."""
    robot, read = arm("lbr_med14"), Mode.parse(mode)
    evaluate, rng = evaluator("lbr_med14", name, mode), np.random.default_rng(1)
    exact = name == "cartesian-error-acceleration"
    seen = curved = 0
    while seen < 5:
        q = np.clip(robot.random_configuration(rng), robot.q_min + 0.2, robot.q_max - 0.2)
        J_free, J_fixed = rows_at(robot, read, q)
        if np.linalg.svd(J_free @ null_projector(J_fixed), compute_uv=False)[-1] < 0.16:
            continue
        seen += 1
        qd = null_projector(J_fixed) @ (0.1 * rng.normal(size=7))
        x, rate = tool_speed(robot, read, q, qd)
        curved += bool(np.linalg.norm(rate) > 1e-3)
        v = x + 0.02 * rng.normal(size=read.m_free)
        result = command(evaluate(q=q, v=v, qd_prev=qd, **({} if exact else {"task_weight": 1e5}), **WIDE))
        # The weights on the joints cost the task little, but not nothing.
        np.testing.assert_allclose(J_free @ result, x + DT / T * (v - x), rtol=0, atol=1e-10 if exact else 2e-6)
        np.testing.assert_allclose(J_fixed @ result, 0.0, atol=1e-12)
    assert curved >= 2


def test_minimum_acceleration_norm_by_pseudo_inverse() -> None:
    """Unhindered: qdd = J^+ (xdd - dJ/dt qd), with guided and locked rows in one J; with damping, about -k qd."""
    robot, mode = arm("lbr_med14"), Mode.fix_orientation()
    evaluate, rng = evaluator("lbr_med14", "minimum-acceleration-norm", "fix-orientation"), np.random.default_rng(2)
    for damping in (0.0, 5.0):
        for _ in range(5):
            q = np.clip(robot.random_configuration(rng), robot.q_min + 0.2, robot.q_max - 0.2)
            J_free, J_fixed = rows_at(robot, mode, q)
            qd = null_projector(J_fixed) @ (0.05 * rng.normal(size=7))
            x, _ = tool_speed(robot, mode, q, qd)
            v = x + 0.005 * rng.normal(size=3)
            J = np.vstack((J_free, J_fixed))
            if np.linalg.svd(J, compute_uv=False)[-1] < 0.1:
                continue
            wanted_speed = np.concatenate((x + DT / T * (v - x), np.zeros(3)))
            target = -damping * qd
            qdd = target + np.linalg.pinv(J) @ ((wanted_speed - J @ qd) / DT - J @ target)
            got = command(
                evaluate(q=q, v=v, qd_prev=qd, task_weight=1e6, joint_damping=damping, scale_penalty=1e3, **WIDE)
            )
            np.testing.assert_allclose((got - qd) / DT, qdd, rtol=0, atol=1e-4 * float(np.abs(qdd).max()))


def test_minimum_torque_norm_by_weighted_pseudo_inverse() -> None:
    """Hollerbach and Suh: qdd = J^# r - (I - J^# J) M^-1 h with the inverse J^# that M^2 weights."""
    robot, mode = arm("lbr_med14"), Mode.fix_orientation()
    evaluate, rng = evaluator("lbr_med14", "minimum-torque-norm", "fix-orientation"), np.random.default_rng(3)
    for _ in range(5):
        q = np.clip(robot.random_configuration(rng), robot.q_min + 0.2, robot.q_max - 0.2)
        J_free, J_fixed = rows_at(robot, mode, q)
        J = np.vstack((J_free, J_fixed))
        qd = null_projector(J_fixed) @ (0.05 * rng.normal(size=7))
        x, _ = tool_speed(robot, mode, q, qd)
        v = x + 0.005 * rng.normal(size=3)
        M, h = robot.mass_matrix(q), robot.bias_forces(q, qd)
        M2 = np.linalg.inv(M @ M)
        inverse = M2 @ J.T @ np.linalg.inv(J @ M2 @ J.T)
        r = (np.concatenate((x + DT / T * (v - x), np.zeros(3))) - J @ qd) / DT
        qdd = inverse @ r - (np.eye(7) - inverse @ J) @ np.linalg.solve(M, h)
        weights = {"task_weight": 1e8, "acceleration_weight": 1e-12, "scale_penalty": 1e5, "stretch_penalty": 1e7}
        got = command(evaluate(q=q, v=v, qd_prev=qd, q_min=-np.inf, q_max=np.inf, qd_max=1e3, **weights, **WIDE))
        np.testing.assert_allclose((got - qd) / DT, qdd, rtol=0, atol=1e-4 * float(np.abs(qdd).max()))


@pytest.mark.parametrize("name", NAMES[:2])
def test_lag_keeps_noise_out_of_the_joints(name: str) -> None:
    """White noise of 1 mm/s on the hand's velocity, at rest: accelerations ten times lower than without lag."""
    robot, q = arm("lbr_med14"), np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
    step, rng = make_step(robot, name, "fix-orientation", "active-set"), np.random.default_rng(9)
    noise = 1e-3 * rng.normal(size=(150, 3))
    rms = {}
    for lag in (0.0, T):
        qd, qdd = np.zeros(7), []
        for v in noise:
            after = step(q, v, qd_prev=qd, time_constant=lag).qd
            qdd.append((after - qd) / DT)
            qd = after
        rms[lag] = float(np.sqrt(np.mean(np.square(qdd))))
    assert rms[T] < 0.1 * rms[0.0]
    assert 0.0 < rms[T] < 0.5
