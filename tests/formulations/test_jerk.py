"""The jerk limit of the robust formulations: what it bounds, when it yields, and what it never costs."""

from __future__ import annotations

import numpy as np
import pytest

from kinqp.formulations import JointSpaceRobust, Mode
from kinqp.formulations.rate import JERK_TIME
from kinqp.solvers import Status, solve
from tests.formulations.least import least
from tests.formulations.reference import evaluator, null_projector, rows_at
from tests.robots.arms import arm

DT = 1e-3
MIDDLE = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])


def test_acceleration_changes_by_a_tick_of_the_jerk_time() -> None:
    """A hand that pulls at once: the most pressed joint's acceleration takes exactly that step, and no slack."""
    evaluate = evaluator("lbr_med14", "joint-space-robust", "position")
    robot = arm("lbr_med14")
    where = evaluate.lowered.variables
    for share in (0.0, 0.3):
        last = share * robot.qdd_max * np.array([1, -1, 1, -1, 1, -1, 1])
        qp = evaluate(q=MIDDLE, v=[0.4, -0.3, 0.2], qd_prev=np.zeros(7), qdd_prev=last).qp
        x = solve(qp).x
        change = (x[where["qd"]] / DT - last) / robot.qdd_max
        assert np.abs(change).max() == pytest.approx(DT / JERK_TIME, rel=1e-6)
        np.testing.assert_allclose(x[[where["excess"].start, where["haste"].start]], 0.0, atol=1e-9)


@pytest.mark.parametrize("mode", ["position", "rcm:-0.12"])
def test_where_the_last_acceleration_is_unknown_only_the_acceleration_is_bounded(mode: str) -> None:
    known, free = (
        evaluator("lbr_med14", name, mode) for name in ("joint-space-robust", "joint-space-robust(jerk=false)")
    )
    rng = np.random.default_rng(0)
    for _ in range(5):
        state = {"q": MIDDLE + 0.2 * rng.normal(size=7), "v": rng.normal(size=Mode.parse(mode).m_free),
                 "qd_prev": 0.1 * rng.normal(size=7)}  # fmt: skip
        one, two = known(**state).qp, free(**state).qp
        for key in ("H", "g", "A", "b", "C", "l", "u", "lb", "ub", "x_feasible"):
            np.testing.assert_array_equal(getattr(one, key), getattr(two, key), err_msg=key)
            assert not np.isnan(getattr(one, key)).any()


@pytest.mark.parametrize("name", ["joint-space-robust", "cartesian-error-robust"])
def test_comfort_yields_before_the_acceleration_limit(name: str) -> None:
    """Against linear programs: the least excess, whatever haste it takes.

    Haste at a hundredth of the price is not quite nothing: one state in fifty may exceed the least, by half a percent.
    """
    robot, hasty, over, above = arm("lbr_med14"), 0, 0, 0
    for mode in ("fix-orientation", "rcm:-0.12"):
        rng = np.random.default_rng(1)
        evaluate = evaluator("lbr_med14", name, mode)
        columns = [evaluate.lowered.variables[slack].start for slack in ("excess", "haste")]
        for k in range(50):
            q = robot.random_configuration(rng)
            _, fixed = rows_at(robot, Mode.parse(mode), q)
            # By turns off the locked rows, and within them but on the way to limits close by.
            qd_prev = null_projector(fixed) @ rng.normal(size=7) * 0.2 + (k % 2) * 0.01 * rng.normal(size=7)
            qdd_prev = robot.qdd_max * rng.uniform(-1.0, 1.0, 7) * (k % 2)
            limits = {} if k % 2 else {"q_max": q + rng.uniform(0.01, 0.1, 7), "q_min": q - rng.uniform(0.01, 0.1, 7)}
            v = 0.2 * rng.normal(size=Mode.parse(mode).m_free)
            qp = evaluate(q=q, v=v, qd_prev=qd_prev, qdd_prev=qdd_prev, **limits).qp
            solution = solve(qp)
            assert solution.status is Status.SOLVED
            lowest = least(qp, columns[0])
            excess, haste = solution.x[columns]
            assert -1e-6 * (1.0 + lowest) < excess - lowest < 5e-3
            above += excess - lowest > 1e-6 * (1.0 + lowest)
            over += excess > 1e-6
            hasty += haste > 1e-6 and excess < 1e-9
    assert above <= 2
    assert hasty > 3
    assert over > 3


def test_jerk_limit_needs_the_rate_limit() -> None:
    with pytest.raises(ValueError, match=r"jerk: expected rate_limit, .* got rate_limit=False"):
        JointSpaceRobust(rate_limit=False)
    assert not JointSpaceRobust(rate_limit=False, jerk=False).jerk
