"""The compiled step against the interpreted one, and both against the robot's own Jacobian and limits."""

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import null_space

from kinqp.codegen import CompiledStep, TickResult
from kinqp.control import InterpretedStep
from kinqp.robots import Robot
from kinqp.solvers import Status
from tests.codegen.compiled import FORMULATIONS, SPEEDS, build_all, compiled, interpreted, near, ticks
from tests.formulations.reference import MODES, bounds_at, rows_at
from tests.robots.arms import arm

Array = NDArray[np.float64]
TOLERANCE = 1e-9
# Two commands that satisfy a locked row to this [m/s, rad/s] are equally right. An interior solver of equalities leaves
# some 1e-14 of rounding per rad/s there.
ROW_ROUNDING = 1e-12
# What 64-bit numbers leave in a row of the task, per unit of the hand's velocity: some 50 units in the last place.
TASK_ROUNDING = 1e-14


def check_safe(step: CompiledStep, result: TickResult, q: Array, case: str, **limits: Array) -> None:
    """Judge a command from pinocchio's Jacobian and from bounds in exact arithmetic."""
    robot = step.robot
    assert np.isfinite(result.qd).all(), case
    low, high = bounds_at(with_limits(robot, **limits), q)
    assert (result.qd >= low - 2e-9).all(), case
    assert (result.qd <= high + 2e-9).all(), case
    _, locked = rows_at(robot, step.mode, q)
    share = np.maximum(np.abs(locked) @ np.abs(result.qd), 1.0)
    assert (np.abs(locked @ result.qd) <= 1e-9 * share).all(), case


class Limited:
    """A robot's limits with others in place of some."""

    def __init__(self, robot: Robot, **limits: Array) -> None:
        for name in ("q_min", "q_max", "qd_max", "qdd_max"):
            setattr(self, name, limits.get(name, getattr(robot, name)))


def with_limits(robot: Robot, **limits: Array) -> Robot:
    return Limited(robot, **limits) if limits else robot  # type: ignore[return-value]  # all that bounds_at reads


def weakest_locked(step: CompiledStep, q: Array) -> float:
    """Smallest singular value of the locked rows that is not zero."""
    _, locked = rows_at(step.robot, step.mode, q)
    sigma = np.linalg.svd(locked, compute_uv=False) if locked.size else np.ones(1)
    return float(np.min(sigma[sigma > 1e-9 * sigma[0]]))


def weakest_equality(reference: InterpretedStep, q: Array, v: Array) -> float:
    """Smallest singular value, zero aside, of what the QP's equalities ask of the command alone.

    An equality in which an unbounded variable of its own stands, such as the Cartesian error, asks nothing of it. A
    bounded one, such as the task's speed, may be at its bound and then takes no part in keeping the row.
    """
    instance = reference.evaluate(q, v)
    moving = np.abs(instance.K).max(axis=0) > 0.0
    bounded = np.isfinite(instance.qp.lb) | np.isfinite(instance.qp.ub)
    rows = null_space(instance.qp.A[:, ~moving & ~bounded].T).T @ instance.qp.A[:, moving]
    sigma = np.linalg.svd(rows, compute_uv=False) if rows.size else np.ones(1)
    return float(np.min(sigma[sigma > 1e-9 * sigma[0]]))


def check_parity(robot: str, formulation: str, mode: str, count: int) -> None:
    step, reference = compiled(robot, formulation, mode, quick=True), interpreted(robot, formulation, mode)
    kinds: Counter[str] = Counter()
    for kind, q, v in ticks(robot, mode, count):
        case = f"{robot}, {formulation}, {mode}, {kind}, q={q!r}, v={v!r}"
        result, wanted = step(q, v), reference(q, v)
        assert result.status is Status.SOLVED, case
        assert wanted.status is Status.SOLVED, case
        check_safe(step, result, q, case)
        scale = max(1.0, float(np.abs(wanted.qd).max()))
        # Along a locked row of singular value sigma the commands differ by its rounding over sigma. Near q = 0 sigma
        # is about 1e-6: that makes 1e-6, where all else is compared to 1e-9. Rows of a task that is an equality are no
        # other: where limits stop it, its speed is zero to rounding, which is all that tells how fast to move along
        # sigma.
        allowed = TOLERANCE
        if "zero" in kind:
            rounding = TASK_ROUNDING * max(1.0, float(np.linalg.norm(v)))
            allowed = max(allowed, ROW_ROUNDING / weakest_locked(step, q), rounding / weakest_equality(reference, q, v))
        assert np.abs(result.qd - wanted.qd).max() <= allowed * scale, case
        assert np.abs(result.eps - wanted.eps).max() <= 2.0 * allowed * scale, case
        kinds[kind] += 1
    assert len(kinds) == 6
    # Runs that were never held back would compare nothing but the unconstrained minimiser.
    narrow = {name: np.clip(getattr(step.robot, name), -2.0, 2.0) for name in ("q_min", "q_max")}
    held = unanswered = 0
    rng = np.random.default_rng(2)
    for _ in range(count):
        q = near(narrow["q_min"], narrow["q_max"], rng)
        v = rng.normal(size=step.mode.m_free) * rng.choice(SPEEDS)
        case = f"{robot}, {formulation}, {mode}, near limits, q={q!r}, v={v!r}"
        result, wanted = step(q, v, **narrow), reference(q, v, **narrow)
        assert result.status is Status.SOLVED, case
        check_safe(step, result, q, case, **narrow)
        if wanted.status is not Status.SOLVED:  # on a limit and singular to 1e-9 at once, the reference may give up
            unanswered += 1
            continue
        scale = max(1.0, float(np.abs(wanted.qd).max()))
        assert np.abs(result.qd - wanted.qd).max() <= TOLERANCE * scale, case
        held += bool(result.active)
    assert held >= count // 4
    assert unanswered <= count // 12


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e"])
def test_compiled_and_interpreted_steps_agree(robot: str, formulation: str) -> None:
    build_all([(robot, formulation, mode) for mode in MODES])
    for mode in MODES:
        check_parity(robot, formulation, mode, 18)


@pytest.mark.parametrize(
    ("robot", "formulation", "mode"),
    [
        ("davinci5", "cartesian-error", "position"),
        ("davinci5", "joint-space", "fix-orientation"),
        ("panda", "joint-space", "fix-position"),
        ("panda", "cartesian-error", "rcm:-0.12"),
    ],
)
def test_they_agree_on_other_arms(robot: str, formulation: str, mode: str) -> None:
    check_parity(robot, formulation, mode, 18)


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("robot", ["lbr_med14", "lbr_med7", "ur5e"])
def test_they_agree_on_many_states(robot: str, formulation: str, mode: str) -> None:
    check_parity(robot, formulation, mode, 1200)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_hardest_states_are_safe(formulation: str) -> None:
    """Limits at full turns, where the wrist is singular too: the optimum may be ill-posed, safety isn't."""
    for mode in ("fix-orientation", "plane:1,-2,0.5", "line:z"):
        step = compiled("ur5e", formulation, mode, quick=True)
        rng = np.random.default_rng(4)
        solved = 0
        for _ in range(200):
            q = near(step.robot.q_min, step.robot.q_max, rng)
            v = rng.normal(size=step.mode.m_free) * rng.choice(SPEEDS)
            result = step(q, v)
            case = f"{mode}, q={q!r}, v={v!r}"
            check_safe(step, result, q, case)
            solved += result.status is Status.SOLVED
            if result.status is not Status.SOLVED:
                assert not result.qd.any(), case
        assert solved >= 198


def test_rows_that_hold_back_are_named_alike() -> None:
    """Where a limit clearly holds the command back, both say so."""
    for formulation in FORMULATIONS:
        step = compiled("lbr_med14", formulation, "fix-orientation")
        reference = interpreted("lbr_med14", formulation, "fix-orientation")
        rng = np.random.default_rng(3)
        named = 0
        for _ in range(40):
            q = arm("lbr_med14").random_configuration(rng)
            v = rng.normal(size=3)
            result, wanted = step(q, v), reference(q, v)
            if result.status is wanted.status is Status.SOLVED:
                assert set(result.active) == set(wanted.active)
                named += len(result.active)
        assert named > 20
