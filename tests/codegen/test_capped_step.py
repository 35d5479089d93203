"""Compiled steps with a cap on the solver's iterations: a command that is admissible, or a stop."""

import numpy as np
import pytest

from kinqp.codegen import compile_step
from kinqp.solvers import Status
from tests.codegen.compiled import FORMULATIONS, compiled, ticks
from tests.codegen.lbr import capped, hard_ticks, lbr
from tests.codegen.test_parity import check_safe
from tests.formulations.reference import bounds_at, rows_at
from tests.robots.arms import arm


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_capped_tick_of_a_feasible_step_is_admissible(formulation: str) -> None:
    robot = arm("lbr_med14")
    unlimited = lbr(formulation)
    stopped = improved = 0
    for cap in range(9):
        step = capped(formulation, cap, feasible=True)
        for q, v in hard_ticks(60, seed=cap):
            result = step(q, v)
            case = f"cap {cap}, q={q!r}, v={v!r}"
            assert result.status in (Status.SOLVED, Status.MAX_ITERATIONS), case
            assert result.iterations <= cap, case
            check_safe(step, result, q, case)
            low, high = bounds_at(robot, q)
            assert (result.qd >= low - 1e-9).all(), case
            assert (result.qd <= high + 1e-9).all(), case
            free, _ = rows_at(robot, step.mode, q)
            np.testing.assert_allclose(free @ result.qd - v, result.eps, rtol=0, atol=1e-9)
            if result.status is Status.MAX_ITERATIONS:
                stopped += 1
                # Never worse than standing still, which is where it starts.
                effort = 1e-4 * result.qd @ result.qd if formulation == "joint-space" else 0.0
                cost = 0.5 * (result.eps @ result.eps + effort)
                assert cost <= 0.5 * v @ v + 1e-9, case
                improved += bool(result.qd.any())
            else:
                wanted = unlimited(q, v)
                assert np.abs(result.qd - wanted.qd).max() <= 1e-7 * max(1.0, np.abs(wanted.qd).max()), case
    assert stopped > 60
    assert improved > 10


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_capped_tick_stops_otherwise(formulation: str) -> None:
    stopped = 0
    for cap in (0, 1, 3):
        step = capped(formulation, cap, feasible=False)
        for q, v in hard_ticks(60):
            result = step(q, v)
            assert result.status in (Status.SOLVED, Status.MAX_ITERATIONS)
            if result.status is Status.MAX_ITERATIONS:
                assert not result.qd.any()
                np.testing.assert_array_equal(result.eps, -v)
                stopped += 1
    assert stopped > 30


def test_a_capped_tick_with_drift_never_leaves_the_bounds() -> None:
    """With drift correction the declared point may be out of bounds: then it is no start."""
    for formulation in FORMULATIONS:
        for cap in (0, 1, 4):
            step = capped(formulation, cap, feasible=True)
            for q, v in hard_ticks(40, seed=11):
                result = step(q, v, v_fixed=[0.3, -0.2, 0.4])
                low, high = bounds_at(arm("lbr_med14"), q)
                assert (result.qd >= low - 1e-9).all()
                assert (result.qd <= high + 1e-9).all()


def test_a_cap_that_is_no_count_is_refused() -> None:
    with pytest.raises(ValueError, match="max_iterations: expected a count that is not negative, got -1"):
        compile_step(arm("lbr_med14"), "cartesian-error", "fix-orientation", max_iterations=-1)


def test_a_capped_tick_without_a_declared_point_stops() -> None:
    """`feasible` has nothing to start from there: the minimiser without rows must not be sent instead."""
    step = compiled("ur5e", "everything", "fix-orientation", quick=True, feasible=True, max_iterations=0)
    rng = np.random.default_rng(6)
    stopped = 0
    for _, q, v in ticks("ur5e", "fix-orientation", 24):
        result = step(q, v, qd_wish=5.0 * rng.normal(size=6), qd_prev=np.zeros(6))
        if result.status is Status.MAX_ITERATIONS:
            assert not result.qd.any()
            stopped += 1
    assert stopped > 5
