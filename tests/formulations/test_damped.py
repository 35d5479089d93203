"""`damped` against the closed form of damped least squares in the null space of the equalities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.linalg import null_space

from kinqp.control import make_step
from kinqp.formulations import DEFAULT_DAMPING, Mode
from kinqp.robots import load_robot
from kinqp.solvers import Status
from tests.formulations.reference import adversarial_state, rows_at
from tests.robots.arms import arm

if TYPE_CHECKING:
    from tests.formulations.reference import Array

ROBOT = load_robot("lbr_med14")
NO_LIMITS = {"q_min": -np.inf, "q_max": np.inf, "qd_max": 1e3}
# The document's example: a straight line along z, turning about it allowed, S = diag(1, 1, 0, 1, 1, 0).
DRILL = Mode("drill", (2, 5), (0, 1, 3, 4), "tool")


def closed_form(J_free: Array, J_fixed: Array, v: Array, e: Array, damping: float) -> Array:
    """Minimiser without inequalities: a particular solution of S'J qd = e and the best motion within its null space."""
    start = np.linalg.pinv(J_fixed) @ e if len(J_fixed) else np.zeros(J_free.shape[1])
    Z = null_space(J_fixed) if len(J_fixed) else np.eye(J_free.shape[1])
    H = J_free.T @ J_free + damping * np.eye(J_free.shape[1])
    return np.asarray(start + Z @ np.linalg.solve(Z.T @ H @ Z, Z.T @ (J_free.T @ v - H @ start)))


@pytest.mark.parametrize("mode", [DRILL, Mode.fix_position(), Mode.free(), Mode.rcm(0.1)], ids=str)
@pytest.mark.parametrize("damping", [DEFAULT_DAMPING, 0.3])
def test_closed_form(mode: Mode, damping: float) -> None:
    rng = np.random.default_rng(1)
    step = make_step(ROBOT, "damped", mode)
    for _ in range(20):
        q, v = ROBOT.random_configuration(rng), 0.3 * rng.normal(size=mode.m_free)
        e = 0.02 * rng.normal(size=mode.m_fixed)
        result = step(q, v, v_fixed=e, damping=damping, **NO_LIMITS)
        assert result.status is Status.SOLVED
        wanted = closed_form(*rows_at(ROBOT, mode, q), v, e, damping)
        np.testing.assert_allclose(result.qd, wanted, rtol=0, atol=1e-9 * max(1.0, np.abs(wanted).max()))


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "panda"])
@pytest.mark.parametrize("mode", ["free", "fix-orientation", "line:z"])
def test_it_is_joint_space_with_one_weight(name: str, mode: str) -> None:
    """Also at limits."""
    robot, read, rng = arm(name), Mode.parse(mode), np.random.default_rng(2)
    damped, other = make_step(robot, "damped", read), make_step(robot, "joint-space", read)
    held = 0
    for trial in range(30):
        q = robot.random_configuration(rng)
        if trial % 2:
            some = rng.choice(robot.nv, 2, replace=False)
            q[some] = np.where(rng.random(2) < 0.5, robot.q_min[some], robot.q_max[some]) * 0.9999
        v = rng.normal(size=read.m_free)
        one, two = damped(q, v), other(q, v, joint_weight=DEFAULT_DAMPING)
        assert one.status is two.status is Status.SOLVED
        np.testing.assert_allclose(one.qd, two.qd, atol=1e-8)
        held += bool(one.active)
    assert held > 5


def test_no_joint_is_faster_than_the_damping_allows() -> None:
    """|v| / (2 sqrt(lambda)) for 0.1 m/s: 1 rad/s, reached where sigma = sqrt(lambda), at a singularity less."""
    step, rng, fastest = make_step(ROBOT, "damped", "position"), np.random.default_rng(3), 0.0
    for bend in np.geomspace(1e-6, 1.0, 40):
        q = np.array([0.0, 0.6, 0.0, -bend, 0.0, bend, 0.0])
        speed = float(np.linalg.norm(step(q, 0.1 * ROBOT.pose(q)[:3, 2], **NO_LIMITS).qd))
        assert speed <= 0.1 / (2.0 * np.sqrt(DEFAULT_DAMPING)) * (1.0 + 1e-9)
        fastest = max(fastest, speed)
    assert fastest > 0.5
    for _ in range(20):
        result = step(adversarial_state(ROBOT, rng), np.zeros(3))
        np.testing.assert_allclose(result.qd, 0.0, atol=1e-12)
