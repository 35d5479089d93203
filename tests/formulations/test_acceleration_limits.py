"""Limits of formulations in accelerations: stopping is feasible, and they yield no more than they must."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np
import pytest

from kinqp.control import make_step
from kinqp.formulations import DATA, Mode, get_formulation, lower
from kinqp.robots import RobotError
from tests.formulations.acceleration_level import ARMS, MODES, NAMES, admissible, command, stretch
from tests.formulations.least import least
from tests.formulations.reference import adversarial_state, evaluator, rows_at
from tests.robots.arms import arm


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


@pytest.mark.parametrize("name", NAMES[1:])
def test_acceleration_limits_yield_no_more_than_they_must(name: str) -> None:
    """The penalty is exact: on admissible states the stretch is the smallest that there is, mostly zero."""
    needed = 0
    for robot, mode in (("lbr_med14", "fix-orientation"), ("panda", "line:z"), ("ur5e", "position")):
        evaluate = evaluator(robot, name, mode)
        for q, qd, v in admissible(arm(robot), mode, 25, seed=8):
            instance = evaluate(q=q, v=v, qd_prev=qd)
            lowest = least(instance.qp, evaluate.lowered.variables["stretch"].start)
            assert stretch(name, robot, mode, instance) == pytest.approx(lowest, abs=1e-6)
            needed += lowest > 1e-6
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
