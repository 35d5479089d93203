"""Thinning keeps what matters: every point was measured, and no extreme is lost."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinqp.benchmarks.report import distribution, extremes

VALUES = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=200)


@given(VALUES, st.integers(1, 40))
def test_points_are_measured_ones_in_order_and_few(values: list[float], buckets: int) -> None:
    at = extremes(values, buckets)
    assert np.all(np.diff(at) > 0)
    assert 0 <= at[0] <= at[-1] < len(values)
    assert len(at) <= 2 * buckets
    assert min(values) in np.array(values)[at]
    assert max(values) in np.array(values)[at]


def test_a_single_spike_among_many_is_kept() -> None:
    values = np.ones(5000)
    values[3217] = 100.0
    assert 3217 in extremes(values, 50)


def test_each_stretch_gives_its_smallest_and_largest() -> None:
    values = [3.0, 1.0, 2.0, 5.0, 9.0, 7.0, 8.0, 6.0]
    assert extremes(values, 2).tolist() == [1, 3, 4, 7]


def test_gaps_are_not_drawn_where_there_is_anything_else() -> None:
    values = [np.nan, 2.0, np.nan, 1.0, np.nan, np.nan, np.nan, np.nan]
    at = extremes(values, 2)
    assert {1, 3} <= set(at.tolist())
    assert np.nanmax(np.array(values)[at]) == 2.0


def test_repeats_of_a_tick_stay_together() -> None:
    # Ticks far apart, three samples each: the two buckets hold two ticks each, not half of the time.
    group = np.repeat([0, 1, 1000, 1001], 3)
    values = np.arange(12.0)
    assert extremes(values, 2, group=group).tolist() == [0, 5, 6, 11]


@given(VALUES)
def test_a_distribution_is_made_of_values_that_occurred(values: list[float]) -> None:
    shares, at = distribution(values)
    assert np.all(np.diff(shares) > 0)
    assert shares[-1] == 1.0
    assert at[-1] == max(values)
    for share, value in zip(shares, at, strict=True):
        assert value in values
        assert np.mean(np.array(values) <= value) >= share - 1e-12


def test_the_far_end_of_a_distribution_is_dense() -> None:
    shares, _ = distribution(np.arange(10_000.0))
    assert np.sum(shares > 0.99) >= 25


@pytest.mark.parametrize(
    ("values", "options", "named"),
    [
        ([1.0], {"buckets": 0}, "buckets"),
        ([[1.0]], {"buckets": 1}, "values"),
        ([1.0, 2.0], {"buckets": 1, "group": [1, 0]}, "group"),
    ],
)
def test_what_is_not_usable_is_named(values: list[float], options: dict[str, int], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        extremes(values, **options)
