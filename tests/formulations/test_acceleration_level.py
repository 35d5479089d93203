"""Acceleration-level formulations: against the velocity level, closed forms, cvxpy and an LP; feasible everywhere."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import casadi as ca
import cvxpy
import numpy as np
import pytest
from cvxpy.atoms.sum_squares import sum_squares
from scipy.optimize import linprog

from kinqp.control import make_step
from kinqp.formulations import DATA, DEFAULT_JOINT_WEIGHT, DEFAULT_TIME_CONSTANT, Mode, get_formulation, lower
from kinqp.robots import RobotError
from kinqp.solvers import get_solver
from tests.finite_differences import difference_jacobian
from tests.formulations.reference import (
    DT,
    adversarial_state,
    bounds_at,
    damped_inverse,
    evaluator,
    null_projector,
    rows_at,
)
from tests.robots.arms import arm

if TYPE_CHECKING:
    from kinqp.control import InterpretedStep
    from kinqp.formulations import Instance
    from kinqp.robots import Robot
    from tests.formulations.reference import Array

NAMES = (
    "cartesian-error-acceleration",
    "joint-space-acceleration",
    "minimum-acceleration-norm",
    "minimum-torque-norm",
)
MODES = ("free", "position", "fix-orientation", "fix-position", "line:z", "plane:0,0,1", "rcm:0.1")
# In quick runs two modes stand for all.
SOME_MODES = [
    pytest.param(mode, marks=() if mode in ("fix-orientation", "free") else pytest.mark.long) for mode in MODES
]
ARMS = ("lbr_med14", "ur5e", "panda")
T = DEFAULT_TIME_CONSTANT
WIDE = {"qdd_max": 1e6}


def solved(instance: Instance) -> Array:
    solution = get_solver("active-set").solve(instance.qp)
    assert solution.solved, solution.message
    return solution.x


def command(instance: Instance) -> Array:
    return np.asarray(instance.K @ solved(instance) + instance.k)


def stretch(name: str, robot: str, mode: str, instance: Instance) -> float:
    return float(solved(instance)[evaluator(robot, name, mode).lowered.variables["stretch"]][0])


def admissible(robot: Robot, mode: str, count: int, seed: int = 0) -> list[tuple[Array, Array, Array]]:
    """Draw (q, qd_prev, v) as a tick of `joint-space` leaves them, half at limits; the hand may change its mind."""
    rng, step = np.random.default_rng(seed), velocity_step(robot, mode)
    states: list[tuple[Array, Array, Array]] = []
    while len(states) < count:
        q = adversarial_state(robot, rng) if len(states) % 2 else robot.random_configuration(rng)
        q = np.clip(q, robot.q_min, robot.q_max)
        v = rng.normal(size=Mode.parse(mode).m_free) * rng.choice([0.01, 0.1, 0.3])
        result = step(q, v)
        if result.status.value == "solved":
            states.append((q + DT * result.qd, result.qd, v + rng.choice([0.0, 0.01, 0.3]) * rng.normal(size=v.size)))
    return states


@functools.cache
def velocity_step(robot: Robot, mode: str) -> InterpretedStep:
    return make_step(robot, "joint-space", mode, "active-set")


def tool_speed(robot: Robot, mode: Mode, q: Array, qd: Array) -> tuple[Array, Array]:
    """Velocity of the guided rows in the tick before, and dJ/dt qd, from finite differences of pinocchio's Jacobian."""
    rate = difference_jacobian(lambda t: rows_at(robot, mode, q + t[0] * qd)[0] @ qd, np.zeros(1))[:, 0]
    return rows_at(robot, mode, q)[0] @ qd - DT * rate, rate


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


def by_cvxpy(name: str, q: Array, qd_prev: Array, v: Array, mode: Mode, *, torque_limits: bool = False) -> Array:
    """State a formulation in accelerations, as documented, from pinocchio's Jacobian and dynamics and exact bounds."""
    robot = arm("lbr_med14")
    J_free, J_fixed = rows_at(robot, mode, q)
    low, high = bounds_at(robot, q)
    x, rate = tool_speed(robot, mode, q, qd_prev)
    change, s = cvxpy.Variable(robot.nv), cvxpy.Variable(nonneg=True)
    qdd = change / T  # cvxpy's solver needs numbers of order one too
    eps = cvxpy.Variable(mode.m_free)
    qd, ahead = qd_prev + DT * qdd, qd_prev + T * qdd
    slowest = np.minimum(np.maximum(low, qd_prev - DT * robot.qdd_max), high)
    fastest = np.maximum(np.minimum(high, qd_prev + DT * robot.qdd_max), low)
    more = s * robot.qdd_max
    constraints = [
        *(qd >= low, qd <= high),
        *(qdd >= (slowest - qd_prev) / DT - more, qdd <= (fastest - qd_prev) / DT + more),
    ]
    # 15 w (1 + s/30)^2 less the constant 15 w, which would cost digits; w is the slope at zero.
    slope = 1e4 if name.startswith("minimum") else 100.0
    objective = slope * (s + cvxpy.square(s) / 60.0)
    if name != "cartesian-error-acceleration" and mode.m_fixed:
        constraints.append(J_fixed @ qd == 0)
    if name.startswith("minimum"):
        scale = cvxpy.Variable()
        v_next = x + DT / T * (v - x)
        constraints += [J_free @ qd == scale * v_next + DT / T * eps, scale >= 0, scale <= 1]
        objective += 0.5 * 1e3 * sum_squares(eps) + 0.5 * cvxpy.square(2 - scale)
        if name == "minimum-torque-norm":
            tau = robot.mass_matrix(q) @ qdd + robot.bias_forces(q, qd_prev)
            objective += 0.5e-5 * sum_squares(tau) + 0.5e-6 * sum_squares(qdd)
        else:
            objective += 0.5e-5 * sum_squares(qdd)
    else:
        objective += 0.5 * sum_squares(eps)
        if name == "joint-space-acceleration":
            constraints.append(J_free @ qdd + rate == (v + eps - x) / T)
            objective += 0.5 * DEFAULT_JOINT_WEIGHT * sum_squares(ahead)
        else:
            beta, N_c = cvxpy.Variable(), null_projector(J_fixed)
            J_sharp = damped_inverse(J_free @ N_c)
            across = (np.eye(7) - N_c) @ qd_prev
            w = v - (T - DT) * rate - J_free @ (across * (1 - T / DT))
            constraints += [
                qd == (1 - beta) * ((1 - DT / T) * N_c @ qd_prev) + DT / T * J_sharp @ (w + eps),
                *(beta >= 0, beta <= 1),
            ]
            objective += 0.5 * cvxpy.square(1 + beta)
    if torque_limits:
        tau, r = robot.mass_matrix(q) @ qdd + robot.bias_forces(q, qd_prev), cvxpy.Variable(nonneg=True)
        constraints.append(cvxpy.abs(tau) <= (1 + r) * (0.2 * robot.tau_max))
        objective += 0.1 * slope * (r + cvxpy.square(r) / 60.0)
    problem = cvxpy.Problem(cvxpy.Minimize(objective), constraints)
    tolerances = {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10}
    problem.solve(solver=cvxpy.CLARABEL, **tolerances)  # type: ignore[no-untyped-call]  # cvxpy has no stubs for it
    assert problem.status == cvxpy.OPTIMAL
    return np.asarray(qd.value)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mode", [*SOME_MODES, pytest.param("rcm:-0.12", marks=pytest.mark.long)])
def test_cvxpy_agrees(name: str, mode: str) -> None:
    evaluate, hindered = evaluator("lbr_med14", name, mode), 0
    for q, qd, v in admissible(arm("lbr_med14"), mode, 8, seed=5):
        got = command(evaluate(q=q, v=v, qd_prev=qd))
        np.testing.assert_allclose(got, by_cvxpy(name, q, qd, v, Mode.parse(mode)), atol=1e-5)
        hindered += bool((np.abs(got - qd) > 0.99 * DT * arm("lbr_med14").qdd_max).any())
    assert hindered >= 3


@pytest.mark.parametrize("name", NAMES)
def test_cvxpy_agrees_on_torque_limits(name: str) -> None:
    """A fifth of the arm's: gravity alone exceeds them now and then."""
    formulation = get_formulation(f"{name}(torque_limits=true)")
    evaluate, robot = evaluator("lbr_med14", formulation, "fix-orientation"), arm("lbr_med14")
    exceeded = 0
    for q, qd, v in admissible(robot, "fix-orientation", 6, seed=6):
        got = command(evaluate(q=q, v=v, qd_prev=qd, tau_max=0.2 * robot.tau_max))
        wanted = by_cvxpy(name, q, qd, v, Mode.fix_orientation(), torque_limits=True)
        np.testing.assert_allclose(got, wanted, atol=1e-5)
        exceeded += bool((np.abs(robot.bias_forces(q, qd)) > 0.2 * robot.tau_max).any())
    assert 0 < exceeded < 6


@functools.cache
def violation_of_the_declared_point(name: str, robot: str, mode: str, *, torque_limits: bool) -> ca.Function:
    """(q, v, qd_prev) to the largest violation of a row by the point that the formulation says is feasible."""
    made = lower(get_formulation(name, torque_limits=torque_limits), arm(robot), Mode.parse(mode))
    symbols = [given.symbol for given in made.inputs]
    data = dict(zip(DATA, made.function(*symbols), strict=True))
    x = data["x_feasible"]
    sides = [
        *(data["A"] @ x - data["b"], data["b"] - data["A"] @ x),
        *(data["C"] @ x - data["u"], data["l"] - data["C"] @ x, x - data["ub"], data["lb"] - x),
    ]
    free = ("q", "v", "qd_prev")
    known = [(given.symbol, ca.SX(given.default)) for given in made.inputs if given.name not in free]
    worst = ca.substitute([ca.mmax(ca.vertcat(*sides))], *map(list, zip(*known, strict=True)))[0]
    inputs = {given.name: given.symbol for given in made.inputs}
    return ca.Function("violation", [inputs[letter] for letter in free], [worst])


def check_feasible(name: str, robot: str, mode: str, count: int, *, torque_limits: bool = False) -> None:
    made, rng = arm(robot), np.random.default_rng(7)
    function = violation_of_the_declared_point(name, robot, mode, torque_limits=torque_limits).map(count)
    q = np.array([adversarial_state(made, rng) if i % 2 else made.random_configuration(rng) for i in range(count)])
    q[::50] = 0.0
    # From rest to twice as fast as the arm may be, whatever the locked rows and limits say of it.
    qd = rng.uniform(-1, 1, q.shape) * made.qd_max * rng.choice([0.0, 1e-9, 1e-3, 0.1, 1.0, 2.0], (count, 1))
    v = rng.normal(size=(count, Mode.parse(mode).m_free)) * rng.choice([0.0, 0.01, 0.3, 3.0], (count, 1))
    worst = np.array(function(q.T, v.T, qd.T))[0]
    assert np.isfinite(worst).all()
    # Sides reach (T/dt) 2 qd_max = 60, eps a hundred times that by a damped inverse, torques 1e5: this is rounding.
    assert worst.max() <= 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_stopping_is_feasible(name: str) -> None:
    for robot, modes in (("lbr_med14", MODES[2:5]), ("ur5e", MODES[:1]), ("panda", MODES[-1:])):
        for mode in modes:
            check_feasible(name, robot, mode, 400)
    check_feasible(name, "lbr_med14", "fix-orientation", 200, torque_limits=True)


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("robot", ARMS)
@pytest.mark.parametrize("name", NAMES)
def test_stopping_is_feasible_from_100_000_states_each(name: str, robot: str, mode: str) -> None:
    check_feasible(name, robot, mode, 100_000)
    check_feasible(name, robot, mode, 10_000, torque_limits=True)


def least_stretch(name: str, robot: str, mode: str, instance: Instance) -> float:
    """Smallest stretch that the rows admit, by SciPy's LP."""
    qp, at = instance.qp, evaluator(robot, name, mode).lowered.variables["stretch"].start
    cost = np.zeros(qp.n)
    cost[at] = 1.0
    rows, sides = np.vstack((qp.C, -qp.C)), np.concatenate((qp.u, -qp.l))
    kept = np.isfinite(sides)
    equal = {"A_eq": qp.A, "b_eq": qp.b} if len(qp.b) else {}
    box = list(zip(qp.lb, qp.ub, strict=True))
    answer = linprog(cost, rows[kept], sides[kept], **equal, bounds=box, method="highs")
    assert answer.status == 0
    return float(answer.x[at])


@pytest.mark.parametrize("name", NAMES[1:])
def test_acceleration_limits_yield_no_more_than_they_must(name: str) -> None:
    """The penalty is exact: on admissible states the stretch is the smallest that there is, mostly zero."""
    needed = 0
    for robot, mode in (("lbr_med14", "fix-orientation"), ("panda", "line:z"), ("ur5e", "position")):
        evaluate = evaluator(robot, name, mode)
        for q, qd, v in admissible(arm(robot), mode, 25, seed=8):
            instance = evaluate(q=q, v=v, qd_prev=qd)
            least = least_stretch(name, robot, mode, instance)
            assert stretch(name, robot, mode, instance) == pytest.approx(least, abs=1e-6)
            needed += least > 1e-6
    assert 0 < needed < 25


def test_locked_rows_come_before_acceleration_limits() -> None:
    """Along a line all joints move in proportion: one that must brake at its limit takes others with it, faster."""
    robot, mode = arm("ur5e"), Mode.parse("line:z")
    q = np.array([0.3, -1.2, 1.5, -0.4, 0.7, 0.2])
    J_free, J_fixed = rows_at(robot, mode, q)
    direction = np.linalg.svd(J_fixed)[2][-1]
    slow, fast = (int(i) for i in np.argsort(np.abs(direction))[[-3, -1]])
    direction *= np.sign(direction[slow])
    qd = 0.5 * direction / abs(direction[fast])
    # The slow joint has one tick's way left: it must brake by a dt at least.
    step = make_step(robot, "joint-space-acceleration", mode, "active-set")
    q_max = robot.q_max.copy()
    q_max[slow] = q[slow] + 1e-3 * (qd[slow] - 0.02)
    result = step(q, J_free @ qd, qd_prev=qd, q_max=q_max)
    assert result.status.value == "solved"
    assert result.fixed_error <= 1e-12
    assert q[slow] + 1e-3 * result.qd[slow] <= q_max[slow] + 1e-12
    assert np.abs(result.qd - qd).max() > 1.5e-3 * robot.qdd_max[0]
    assert any("acceleration limits[" in name for name in result.active)
    # A joint of its own, in a mode that locks nothing, brakes alone.
    free = make_step(robot, "joint-space-acceleration", "position", "active-set")
    other = rows_at(robot, Mode.position(), q)[0]
    near = robot.q_max.copy()
    near[slow] = q[slow] + 1e-5
    alone = free(q, other @ np.zeros(6), qd_prev=np.zeros(6), q_max=near)
    assert (np.abs(alone.qd) <= 1e-3 * robot.qdd_max + 1e-12).all()


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


def test_torques_need_inertias() -> None:
    for name in ("minimum-torque-norm", "joint-space-acceleration(torque_limits=true)"):
        with pytest.raises(RobotError, match="expected a robot with link inertias"):
            lower(get_formulation(name), arm("davinci5"), Mode.position())


def test_unknown_torque_limits_are_none() -> None:
    with_limits = evaluator("lbr_med14", get_formulation("joint-space-acceleration(torque_limits=true)"), "position")
    without = evaluator("lbr_med14", "joint-space-acceleration", "position")
    for q, qd, v in admissible(arm("lbr_med14"), "position", 4, seed=10):
        instance = with_limits(q=q, v=v, qd_prev=qd, tau_max=np.inf)
        assert np.isfinite(instance.qp.C).all()
        np.testing.assert_allclose(command(instance), command(without(q=q, v=v, qd_prev=qd)), rtol=0, atol=1e-9)
