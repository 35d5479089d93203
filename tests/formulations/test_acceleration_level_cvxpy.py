"""Formulations in accelerations against cvxpy, with pinocchio's dynamics and exact bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cvxpy
import numpy as np
import pytest
from cvxpy.atoms.sum_squares import sum_squares

from kinqp.formulations import DEFAULT_JOINT_WEIGHT, Mode, get_formulation
from tests.formulations.acceleration_level import NAMES, SOME_MODES, T, admissible, command, tool_speed
from tests.formulations.reference import DT, bounds_at, damped_inverse, evaluator, null_projector, rows_at
from tests.robots.arms import arm

if TYPE_CHECKING:
    from tests.formulations.reference import Array


# Beyond rounding; cvxpy's solver is asked for 1e-10.
CLOSE = 1e-8


def by_cvxpy(
    name: str,
    q: Array,
    qd_prev: Array,
    v: Array,
    mode: Mode,
    *,
    torque_limits: bool = False,
    near: Array | None = None,
) -> tuple[Array, float]:
    """State a formulation in accelerations, as documented, from pinocchio's Jacobian and dynamics and exact bounds.

    The command and its cost; of the commands `near` one, if that is given.
    """
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
    if near is not None:
        constraints.append(cvxpy.abs(qd - near) <= CLOSE)
    problem = cvxpy.Problem(cvxpy.Minimize(objective), constraints)
    tolerances = {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10}
    problem.solve(solver=cvxpy.CLARABEL, **tolerances)  # type: ignore[no-untyped-call]  # cvxpy has no stubs for it
    assert problem.status == cvxpy.OPTIMAL
    return np.asarray(qd.value), float(problem.value)


def check(got: Array, name: str, *state: Array, mode: Mode, torque_limits: bool = False) -> None:
    """The command that cvxpy finds or, where the cost is too flat for its solver to tell, one that costs no more."""
    wanted, least = by_cvxpy(name, *state, mode, torque_limits=torque_limits)
    if not np.allclose(got, wanted, rtol=0, atol=1e-5):
        _, cost = by_cvxpy(name, *state, mode, torque_limits=torque_limits, near=got)
        assert cost <= least + CLOSE * max(1.0, abs(least)), (got, wanted)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("mode", [*SOME_MODES, pytest.param("rcm:-0.12", marks=pytest.mark.long)])
def test_cvxpy_agrees(name: str, mode: str) -> None:
    evaluate, hindered = evaluator("lbr_med14", name, mode), 0
    # Of these modes' states few are held back.
    count = 24 if mode in ("fix-position", "line:z") else 8
    for q, qd, v in admissible(arm("lbr_med14"), mode, count, seed=5):
        got = command(evaluate(q=q, v=v, qd_prev=qd))
        check(got, name, q, qd, v, mode=Mode.parse(mode))
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
        check(got, name, q, qd, v, mode=Mode.fix_orientation(), torque_limits=True)
        exceeded += bool((np.abs(robot.bias_forces(q, qd)) > 0.2 * robot.tau_max).any())
    assert 0 < exceeded < 6
