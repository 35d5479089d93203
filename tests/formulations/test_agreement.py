"""What DESIGN section 5 says of the two formulations, checked; cvxpy as an opinion that shares no code with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cvxpy
import numpy as np
import pytest
from cvxpy.atoms.sum_squares import sum_squares

from kinqp.formulations import DEFAULT_JOINT_WEIGHT, Mode
from kinqp.solvers import get_solver
from tests.formulations.reference import (
    MODES,
    THRESHOLD,
    adversarial_state,
    bounds_at,
    damped_inverse,
    evaluator,
    null_projector,
    rows_at,
)
from tests.robots.arms import arm

if TYPE_CHECKING:
    from kinqp.formulations import Instance
    from kinqp.solvers import Solver
    from tests.formulations.reference import Array

ROBOT = arm("lbr_med14")
MODE = "fix-orientation"
SOLVER_SLACK = 1e-6


def solver() -> Solver:
    return get_solver("clarabel", tolerance=1e-10)


def command(backend: Solver, instance: Instance) -> tuple[Array, Array]:
    """Command and Cartesian error; reset, since Clarabel's scaling is that of the last set-up."""
    backend.reset()
    solution = backend.solve(instance.qp)
    assert solution.solved, solution.message
    qd = instance.K @ solution.x + instance.k
    return qd, instance.J_free @ qd - instance.v


def sigma_min(q: Array, mode: str = MODE) -> float:
    J_free, J_fixed = rows_at(ROBOT, Mode.parse(mode), q)
    return float(np.linalg.svd(J_free @ null_projector(J_fixed), compute_uv=False)[-1])


def undamped(q: Array, mode: str = MODE) -> bool:
    """Whether damping is off for sure: the estimate may be m^(1/4) below sigma_min."""
    return bool(sigma_min(q, mode) > THRESHOLD * Mode.parse(mode).m_free ** 0.25 * 1.01)


def agreeing_states(count: int, seed: int) -> list[tuple[Array, Array]]:
    """Non-singular states, 0.1 rad from every limit, and slow hands that no bound holds back."""
    rng = np.random.default_rng(seed)
    states: list[tuple[Array, Array]] = []
    while len(states) < count:
        q = np.clip(ROBOT.random_configuration(rng), ROBOT.q_min + 0.1, ROBOT.q_max - 0.1)
        v = rng.normal(size=3)
        v *= 0.02 / np.linalg.norm(v)
        if undamped(q):  # so that |qd| <= 0.02/0.1, below every bound, 0.1 rad from a limit: sqrt(2 * 10 * 0.1) = 1.4
            states.append((q, v))
    return states


@pytest.mark.parametrize("count", [1000, pytest.param(5_000, marks=pytest.mark.long)])
def test_away_from_limits_and_singularities_they_agree(count: int) -> None:
    """Unhindered, qd_js = J_bar' (J_bar J_bar' + mu I)^-1 v and qd_ce = J_bar' (J_bar J_bar')^-1 v.

    Along a singular direction they are sigma/(sigma^2 + mu) and 1/sigma: apart by mu/(sigma^2 + mu) of the latter.
    """
    ce, js, backend = (
        evaluator("lbr_med14", "cartesian-error", MODE),
        evaluator("lbr_med14", "joint-space", MODE),
        solver(),
    )
    mu = DEFAULT_JOINT_WEIGHT
    largest = 0.0
    for q, v in agreeing_states(count, seed=1):
        one, _ = command(backend, ce(q=q, v=v))
        two, _ = command(backend, js(q=q, v=v))
        share = mu / (sigma_min(q) ** 2 + mu)
        apart = float(np.linalg.norm(two - one))
        assert apart <= share * float(np.linalg.norm(one)) + SOLVER_SLACK
        largest = max(largest, apart)
    assert largest > 10 * SOLVER_SLACK  # it is the joint weight that is seen here, not the solver's slack


def test_the_smaller_the_joint_weight_the_closer_they_are() -> None:
    ce, js, backend = (
        evaluator("lbr_med14", "cartesian-error", MODE),
        evaluator("lbr_med14", "joint-space", MODE),
        solver(),
    )
    apart = []
    states = agreeing_states(50, seed=2)
    for mu in (1e-2, 1e-4, 1e-6):
        difference = [
            command(backend, js(q=q, v=v, joint_weight=mu))[0] - command(backend, ce(q=q, v=v))[0] for q, v in states
        ]
        apart.append(float(np.linalg.norm(difference, axis=1).max()))
        share = max(mu / (sigma_min(q) ** 2 + mu) for q, _ in states)
        assert apart[-1] <= share * 0.02 / THRESHOLD + 1e-5
    assert apart[2] < 0.1 * apart[1] < 0.1 * apart[0]


@pytest.mark.parametrize("mode", ["fix-orientation", "position", "rcm:-0.12"])
def test_at_limits_joint_space_is_never_worse(mode: str) -> None:
    """Undamped, the command of cartesian-error is feasible for joint-space, whose minimum is then no larger.

    With different joint weights it is that objective that is compared; the error alone may lose what the weight buys.
    """
    ce, js = evaluator("lbr_med14", "cartesian-error", mode), evaluator("lbr_med14", "joint-space", mode)
    rng, backend, mu = np.random.default_rng(3), solver(), DEFAULT_JOINT_WEIGHT
    hindered = strictly = 0
    states = 0
    while states < 60:
        q, v = adversarial_state(ROBOT, rng), 0.3 * rng.normal(size=Mode.parse(mode).m_free)
        if not undamped(q, mode):
            continue
        states += 1
        one, eps_one = command(backend, ce(q=q, v=v))
        two, eps_two = command(backend, js(q=q, v=v))
        cost_one = 0.5 * (eps_one @ eps_one) + 0.5 * mu * (one @ one)
        cost_two = 0.5 * (eps_two @ eps_two) + 0.5 * mu * (two @ two)
        assert cost_two <= cost_one + 1e-8
        hindered += bool(np.linalg.norm(eps_one) > 1e-3)
        strictly += bool(np.linalg.norm(eps_two) < np.linalg.norm(eps_one) - 1e-3)
    assert hindered > 20  # these are states at limits
    assert strictly > 0  # where self-motion helps


@pytest.mark.parametrize("formulation", ["cartesian-error", "joint-space"])
@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "davinci5", "kinova"])
@pytest.mark.parametrize("mode", MODES)
def test_zero_motion_is_always_feasible(formulation: str, name: str, mode: str) -> None:
    robot, read, rng = arm(name), Mode.parse(mode), np.random.default_rng(4)
    evaluate = evaluator(name, formulation, mode)
    for trial in range(40):
        q = adversarial_state(robot, rng) if trial % 2 else robot.random_configuration(rng)
        v = rng.normal(size=read.m_free)
        instance = evaluate(q=q, v=v)
        qp, x = instance.qp, instance.qp.x_feasible
        assert x is not None
        np.testing.assert_array_equal(x[: read.m_free], -v)
        # Commands reach |J#| |v| = 15 * 5 here; their rounding is 1e-16 of that.
        violation = np.maximum(qp.stacked @ x - qp.upper, qp.lower - qp.stacked @ x)
        assert violation.max() <= 1e-13
        assert np.abs(instance.K @ x + instance.k).max() <= 1e-13


def by_cvxpy(formulation: str, q: Array, v: Array, mode: Mode) -> Array:
    """State a formulation from pinocchio's Jacobian and exact bounds, in cvxpy's own words."""
    J_free, J_fixed = rows_at(ROBOT, mode, q)
    low, high = bounds_at(ROBOT, q)
    eps = cvxpy.Variable(mode.m_free)
    qd: cvxpy.Expression
    if formulation == "cartesian-error":
        J_sharp = cvxpy.Constant(damped_inverse(J_free @ null_projector(J_fixed)))
        qd = J_sharp @ (v + eps)
        objective = 0.5 * sum_squares(eps)
        constraints = []
    else:
        qd = cvxpy.Variable(ROBOT.nv)
        objective = 0.5 * sum_squares(eps) + 0.5 * DEFAULT_JOINT_WEIGHT * sum_squares(qd)
        constraints = [J_free @ qd - eps == v]
        if mode.m_fixed:
            constraints.append(J_fixed @ qd == 0)
    problem = cvxpy.Problem(cvxpy.Minimize(objective), [*constraints, qd >= low, qd <= high])
    tolerances = {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}
    problem.solve(solver=cvxpy.CLARABEL, **tolerances)  # type: ignore[no-untyped-call]  # cvxpy has no stubs for it
    assert problem.status == cvxpy.OPTIMAL
    return np.asarray(qd.value)


@pytest.mark.parametrize("formulation", ["cartesian-error", "joint-space"])
@pytest.mark.parametrize("mode", ["fix-orientation", "rcm:-0.12", "free"])
def test_cvxpy_agrees(formulation: str, mode: str) -> None:
    read, evaluate = Mode.parse(mode), evaluator("lbr_med14", formulation, mode)
    rng, backend = np.random.default_rng(5), solver()
    on_a_bound = 0
    for trial in range(20):
        q = ROBOT.random_configuration(rng)
        if trial % 2:  # three joints on or near a limit
            some = rng.choice(7, 3, replace=False)
            q[some] = np.where(rng.random(3) < 0.5, ROBOT.q_min[some], ROBOT.q_max[some]) * rng.choice(
                [1.0, 1 - 1e-5], 3
            )
        v = 0.2 * rng.normal(size=read.m_free)
        instance = evaluate(q=q, v=v)
        qd, _ = command(backend, instance)
        np.testing.assert_allclose(qd, by_cvxpy(formulation, q, v, read), atol=1e-5)
        on_a_bound += bool(np.any((instance.qd_hi - qd < 1e-6) | (qd - instance.qd_lo < 1e-6)))
    assert on_a_bound >= 5
