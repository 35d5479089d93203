"""The least acceleration of a tick, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from kinqp.benchmarks.least_acceleration import least_acceleration, unforced_excess

WIDE = np.full(2, 9.0)
STEP = np.array([0.01, 0.02])


def test_without_rows_the_last_command_can_be_kept() -> None:
    assert least_acceleration(np.zeros((0, 2)), np.array([1.0, -2.0]), -WIDE, WIDE, STEP) == pytest.approx(0.0)


def test_a_bound_below_the_last_command_asks_for_braking() -> None:
    high = np.array([0.95, 9.0])
    assert least_acceleration(np.zeros((0, 2)), np.array([1.0, 0.0]), -WIDE, high, STEP) == pytest.approx(5.0)


def test_a_locked_row_shares_the_way_by_the_limits() -> None:
    """qd_0 + qd_1 = 0 from (0.03, 0.03): with steps of 0.01 and 0.02 each takes two of its own."""
    row = np.array([[1.0, 1.0]])
    last = np.array([0.03, 0.03])
    assert least_acceleration(row, last, -WIDE, WIDE, STEP) == pytest.approx(2.0)
    assert least_acceleration(np.vstack((row, 2.0 * row)), last, -WIDE, WIDE, STEP) == pytest.approx(2.0)


def test_unforced_is_what_is_beyond_limit_and_least() -> None:
    row, q = np.array([[1.0, 1.0]]), np.zeros(2)
    limits = (np.full(2, -3.0), np.full(2, 3.0), np.full(2, 5.0), np.array([10.0, 20.0]))
    last = np.array([0.03, 0.03])
    forced, more = np.array([0.01, -0.01]), np.array([0.0, 0.0])
    assert unforced_excess(row, q, (last, forced), limits, 1e-3) == pytest.approx(0.0, abs=1e-9)
    assert unforced_excess(row, q, (last, more), limits, 1e-3) == pytest.approx(1.0)
    assert unforced_excess(np.zeros((0, 2)), q, (last, last + STEP), limits, 1e-3) == 0.0
    assert unforced_excess(np.zeros((0, 2)), q, (last, last + 1.5 * STEP), limits, 1e-3) == pytest.approx(0.5)


def test_bounds_without_zero_are_refused() -> None:
    with pytest.raises(ArithmeticError, match="expected bounds around zero"):
        least_acceleration(np.array([[1.0, 1.0]]), np.zeros(2), np.ones(2), WIDE, STEP)
