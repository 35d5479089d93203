"""`minimum-velocity-norm`, `minimum-kinetic-energy` and `task-scaling` against closed forms, and against SciPy's LP."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import linprog

from kinqp.control import InterpretedStep, make_step
from kinqp.formulations import (
    MinimumKineticEnergy,
    MinimumVelocityNorm,
    Mode,
    TaskScaling,
    factor_of_positive,
    get_formulation,
)
from kinqp.robots import Robot, RobotError
from kinqp.solvers import Status
from tests.formulations.reference import adversarial_state, bounds_at, rows_at
from tests.robots.arms import arm

if TYPE_CHECKING:
    from tests.formulations.reference import Array

SCALED = ("minimum-velocity-norm", "minimum-kinetic-energy", "task-scaling")
SIGMA_0 = {"minimum-velocity-norm": 0.08, "minimum-kinetic-energy": 0.25, "task-scaling": 0.01}
MODES = ("free", "position", "fix-orientation", "fix-position", "line:z", "plane:0,0,1", "rcm:0.1")
# Nothing but the task holds these back.
NO_LIMITS = {"q_min": -np.inf, "q_max": np.inf, "qd_max": 1e3}
Q = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
V = np.array([0.1, 0.0, -0.05])


def stacked(robot: Robot, mode: Mode, q: Array, v: Array) -> tuple[Array, Array]:
    """All rows that the command has to obey, and what they ask for."""
    J_free, J_fixed = rows_at(robot, mode, q)
    return np.vstack((J_free, J_fixed)), np.concatenate((v, np.zeros(len(J_fixed))))


def scale_of(eps: Array, v: Array) -> float:
    """s in eps = (s - 1) v."""
    return float(1.0 + eps @ v / (v @ v))


def norm_of(formulation: str, robot: Robot, q: Array) -> Array:
    """The matrix in whose norm joint speed is least."""
    M = robot.mass_matrix(q)
    return M / (np.trace(M) / robot.nv) if formulation == "minimum-kinetic-energy" else np.eye(robot.nv)


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "panda"])
@pytest.mark.parametrize("formulation", SCALED)
def test_unhindered_it_is_the_weighted_inverse(formulation: str, name: str) -> None:
    """W^-1 J' (J W^-1 J')^-1 v (eq. 3.5), scaled by min(1, 2 sigma^2/(sigma^2 + sigma_0^2))."""
    robot, rng = arm(name), np.random.default_rng(1)
    sigma_0 = SIGMA_0[formulation]
    scales = []
    for text in MODES:
        mode = Mode.parse(text)
        step = make_step(robot, formulation, mode)
        for _ in range(20):
            q, v = robot.random_configuration(rng), 0.2 * rng.normal(size=mode.m_free)
            J, wanted = stacked(robot, mode, q, v)
            if np.linalg.svd(J, compute_uv=False)[-1] < 1e-3:
                continue
            W = norm_of(formulation, robot, q)
            weighted = np.linalg.solve(W, J.T)
            full = weighted @ np.linalg.solve(J @ weighted, wanted)
            sigma = float(np.linalg.norm(v) / np.sqrt(full @ W @ full))
            scales.append(min(1.0, 2.0 * sigma**2 / (sigma**2 + sigma_0**2)))
            result = step(q, v, **NO_LIMITS)
            assert result.status is Status.SOLVED
            np.testing.assert_allclose(result.qd, scales[-1] * full, rtol=0, atol=1e-9 * max(1.0, np.abs(full).max()))
    assert sum(scale == 1.0 for scale in scales) > 40
    assert formulation == "task-scaling" or sum(scale < 0.9 for scale in scales) > 1


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "panda"])
@pytest.mark.parametrize("formulation", SCALED)
def test_the_direction_is_kept(formulation: str, name: str) -> None:
    """On and beyond limits, at singularities, whatever the speed: J_free qd = s v with s in [0, 1]."""
    robot, rng = arm(name), np.random.default_rng(2)
    slowed = 0
    for text in MODES:
        mode = Mode.parse(text)
        step = make_step(robot, formulation, mode)
        for trial in range(15):
            q = (adversarial_state(robot, rng), np.zeros(robot.nv), robot.random_configuration(rng))[trial % 3]
            v = rng.normal(size=mode.m_free) * rng.choice([1e-6, 0.1, 1.0])
            result = step(q, v)
            assert result.status is Status.SOLVED, (text, q, v, result.message)
            scale = scale_of(result.eps, v)
            assert -1e-9 <= scale <= 1.0 + 1e-9
            np.testing.assert_allclose(result.eps, (scale - 1.0) * v, rtol=0, atol=1e-9 * max(1.0, np.abs(v).max()))
            slowed += scale < 0.99
    assert slowed > 30


@pytest.mark.parametrize("formulation", SCALED)
def test_at_a_singularity_it_slows_down(formulation: str) -> None:
    """Towards the stretched arm, pulled outwards: the speed fades out, and joints obey |qd| <= |v| / sigma_0."""
    robot = arm("lbr_med14")
    step = make_step(robot, formulation, "position")
    sigma_0 = SIGMA_0[formulation]
    scales, speeds = [], []
    for bend in (0.5, 0.1, 0.03, 0.01, 1e-3, 1e-6, 0.0):
        q = np.array([0.0, 0.6, 0.0, -bend, 0.0, bend, 0.0])
        v = 0.1 * robot.pose(q)[:3, 2]  # along the arm, as far as it is straight
        result = step(q, v, **NO_LIMITS)
        assert result.status is Status.SOLVED
        scales.append(scale_of(result.eps, v))
        speeds.append(float(np.sqrt(result.qd @ norm_of(formulation, robot, q) @ result.qd)))
    assert scales[0] == pytest.approx(1.0, abs=1e-9)
    assert (np.diff(scales) < 1e-9).all()
    assert scales[-1] == pytest.approx(0.0, abs=1e-9)
    assert max(speeds) <= 0.1 / sigma_0 * (1.0 + 1e-9)
    assert speeds[-1] <= 1e-9


def largest_scale(robot: Robot, mode: Mode, q: Array, v: Array) -> float:
    """The linear programme max s, by HiGHS."""
    J_free, J_fixed = rows_at(robot, mode, q)
    low, high = bounds_at(robot, q)
    rows = np.vstack((np.column_stack((J_free, -v)), np.column_stack((J_fixed, np.zeros(len(J_fixed))))))
    cost = np.append(np.zeros(robot.nv), -1.0)
    box = [*zip(low, high, strict=True), (0.0, 1.0)]
    found = linprog(cost, A_eq=rows, b_eq=np.zeros(len(rows)), bounds=box, method="highs")
    assert found.status == 0, found.message
    return float(found.x[-1])


@pytest.mark.parametrize("mode", ["fix-orientation", "free", "rcm:0.1"])
def test_task_scaling_finds_the_largest_scale(mode: str) -> None:
    robot, read, rng = arm("lbr_med14"), Mode.parse(mode), np.random.default_rng(3)
    step, hindered = make_step(robot, "task-scaling", read), 0
    for trial in range(60):
        q = robot.random_configuration(rng)
        if trial % 2:
            some = rng.choice(7, 3, replace=False)
            q[some] = np.where(rng.random(3) < 0.5, robot.q_min[some], robot.q_max[some])
        v = rng.normal(size=read.m_free) * rng.choice([0.05, 0.3, 1.0])
        J, _ = stacked(robot, read, q, v)
        if np.linalg.svd(J, compute_uv=False)[-1] < 0.05:
            continue
        scale = scale_of(step(q, v).eps, v)
        assert scale == pytest.approx(largest_scale(robot, read, q, v), abs=1e-6)
        hindered += scale < 0.99
    assert hindered > 15


def test_self_motion_makes_up_for_a_joint_at_its_limit() -> None:
    """The elbow may not move, the pseudo-inverse would move it: the others follow the hand in full, at least effort."""
    robot, mode = arm("lbr_med14"), Mode.position()
    J, _ = rows_at(robot, mode, Q)
    v = 0.1 * J[:, 3] / np.linalg.norm(J[:, 3])
    assert abs(np.linalg.pinv(J) @ v)[3] > 0.05
    bound = np.ones(7)
    bound[3] = 1e-9
    others = np.delete(J, 3, axis=1)
    for formulation in ("minimum-velocity-norm", "task-scaling"):
        result = make_step(robot, formulation, mode)(Q, v, qd_max=bound)
        np.testing.assert_allclose(result.eps, 0.0, atol=1e-8)
        np.testing.assert_allclose(np.delete(result.qd, 3), np.linalg.pinv(others) @ v, atol=1e-7)


def test_kinetic_energy_is_least() -> None:
    robot, mode, rng = arm("lbr_med14"), Mode.fix_orientation(), np.random.default_rng(4)
    least, other = make_step(robot, "minimum-kinetic-energy", mode), make_step(robot, "minimum-velocity-norm", mode)
    saved = []
    for _ in range(60):
        q, v = robot.random_configuration(rng), 0.05 * rng.normal(size=3)
        one, two = least(q, v), other(q, v)
        if np.linalg.norm(one.eps) + np.linalg.norm(two.eps) > 1e-8:
            continue
        M = robot.mass_matrix(q)
        energies = one.qd @ M @ one.qd, two.qd @ M @ two.qd
        assert energies[0] <= energies[1] * (1.0 + 1e-9)
        assert np.linalg.norm(two.qd) <= np.linalg.norm(one.qd) * (1.0 + 1e-9)
        saved.append(1.0 - energies[0] / energies[1])
    assert len(saved) > 25
    assert np.mean(saved) > 0.05


def hard(formulation: str) -> InterpretedStep:
    return make_step(arm("lbr_med14"), f"{formulation}(task=hard)", "fix-orientation")


@pytest.mark.parametrize("formulation", ["minimum-velocity-norm", "minimum-kinetic-energy"])
def test_the_hard_task_stops_where_the_scaled_one_goes_on(formulation: str) -> None:
    scaled = make_step(arm("lbr_med14"), formulation, "fix-orientation")
    np.testing.assert_allclose(hard(formulation)(Q, V).qd, scaled(Q, V).qd, atol=1e-9)
    slow = 0.3 * np.abs(scaled(Q, V).qd).max()
    stopped, slowed = hard(formulation)(Q, V, qd_max=slow), scaled(Q, V, qd_max=slow)
    assert stopped.status is Status.PRIMAL_INFEASIBLE
    assert not stopped.qd.any()
    assert slowed.status is Status.SOLVED
    assert 0.2 < scale_of(slowed.eps, V) < 0.9


@pytest.mark.parametrize("formulation", SCALED)
def test_drift_is_corrected_while_the_hand_rests_or_is_blocked(formulation: str) -> None:
    """Then s scales what the hand asks beyond the motion that the correction takes."""
    robot, drift = arm("lbr_med14"), np.array([0.0, 0.01, -0.005])
    step = make_step(robot, formulation, "fix-orientation")
    J = robot.jacobian(Q)
    resting = np.linalg.pinv(J[3:]) @ drift
    for v, limits in ((np.zeros(3), {}), (V, {}), (V, {"qd_max": 1.2 * np.abs(resting).max()}), (J[:3] @ resting, {})):
        result = step(Q, v, v_fixed=drift, **limits)
        assert result.status is Status.SOLVED
        np.testing.assert_allclose(J[3:] @ result.qd, drift, atol=1e-9)
        wish = v - J[:3] @ resting
        got = J[:3] @ (result.qd - resting)
        scale = float(got @ wish / max(float(wish @ wish), 1e-30))
        np.testing.assert_allclose(got, scale * wish, atol=1e-9)
        assert -1e-9 <= scale <= 1.0 + 1e-9
        if not limits:
            np.testing.assert_allclose(J[:3] @ result.qd, v, atol=1e-9)
    assert 0.0 < scale_of(step(Q, V, qd_max=0.05).eps, V) < 0.9


@pytest.mark.parametrize("formulation", SCALED)
def test_a_resting_hand_is_a_resting_arm(formulation: str) -> None:
    rng = np.random.default_rng(5)
    step = make_step(arm("lbr_med14"), formulation, "fix-orientation")
    for _ in range(20):
        result = step(adversarial_state(arm("lbr_med14"), rng), np.zeros(3))
        assert result.status is Status.SOLVED
        np.testing.assert_allclose(result.qd, 0.0, atol=1e-12)


def test_unknown_words_and_unknown_masses_are_refused() -> None:
    for cls in (MinimumVelocityNorm, MinimumKineticEnergy):
        with pytest.raises(ValueError, match=r"^task: expected one of scaled, hard, got 'soft'"):
            cls(task="soft")  # type: ignore[arg-type]  # that is the point
        assert get_formulation(f"{cls.name}(task=hard)") == cls(task="hard")
    assert get_formulation("task-scaling") == TaskScaling()
    with pytest.raises(RobotError, match="mass_matrix: expected a robot with link inertias"):
        make_step(arm("davinci5"), "minimum-kinetic-energy", "position")


def test_factors_of_a_positive_matrix() -> None:
    rng = np.random.default_rng(6)
    root = rng.normal(size=(7, 7))
    matrix = root @ root.T + 0.1 * np.eye(7)
    lower, pivots, reciprocals = (np.array(ca.evalf(part)) for part in factor_of_positive(ca.SX(matrix)))
    np.testing.assert_allclose(lower * np.sqrt(pivots[:, 0]), np.linalg.cholesky(matrix), atol=1e-12)
    np.testing.assert_allclose(pivots * reciprocals, 1.0, rtol=1e-15)
