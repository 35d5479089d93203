"""Mood's median test against the formula by hand, and Holm's correction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from kinqp.benchmarks.study.median_test import holm, median_test


def test_a_table_worked_out_by_hand() -> None:
    # Median of all is 3: above it are 1 of 4 and 3 of 4, and N (ad - bc)^2 / (row and column sums) is 2.
    found = median_test({"first": [1.0, 2.0, 3.0, 5.0], "second": [3.0, 4.0, 5.0, 6.0]})
    assert found.names == ("first", "second")
    assert found.median == 3.5
    assert (found.above, found.rest) == ((1, 3), (3, 1))
    assert found.statistic == pytest.approx(8 * (1 * 1 - 3 * 3) ** 2 / 4**4)
    assert found.p_value == pytest.approx(stats.chi2.sf(2.0, 1))
    assert found.smallest_expected == 2.0


def test_ties_with_the_median_are_not_above_it() -> None:
    found = median_test({"first": [1, 2, 2, 2], "second": [2, 2, 2, 3]})
    assert found.median == 2.0
    assert (found.above, found.rest) == ((0, 1), (4, 3))


def test_yates_takes_half_a_count() -> None:
    samples = {"first": [1, 2, 3, 5], "second": [3, 4, 5, 6]}
    found = median_test(samples, correction=True)
    assert found.statistic == pytest.approx(8 * (abs(1 - 9) - 8 / 2) ** 2 / 4**4)


def test_without_a_value_above_the_median_nothing_is_split() -> None:
    found = median_test({"first": [0, 0, 0], "second": [0, 0, 0]})
    assert (found.above, found.statistic, found.p_value, found.smallest_expected) == ((0, 0), None, None, 0.0)
    assert median_test({"first": [0, 0, 0], "second": [-1, 0]}).statistic is None


values = st.lists(st.integers(0, 9), min_size=1, max_size=30)


@given(st.lists(values, min_size=2, max_size=4))
def test_it_is_the_chi_squared_of_its_own_counts(samples: list[list[int]]) -> None:
    found = median_test({str(number): sample for number, sample in enumerate(samples)})
    pooled = np.concatenate(samples)
    assert found.median == np.median(pooled)
    if found.statistic is None:
        assert pooled.max() == found.median
        return
    counts = np.array([found.above, found.rest], dtype=float)
    expected = counts.sum(axis=0) * counts.sum(axis=1, keepdims=True) / counts.sum()
    assert found.statistic == pytest.approx(np.sum((counts - expected) ** 2 / expected), abs=1e-12)
    assert found.p_value == pytest.approx(stats.chi2.sf(found.statistic, len(samples) - 1))
    assert found.smallest_expected == pytest.approx(expected.min())


@pytest.mark.parametrize("bad", [[], [1.0, np.nan], [np.inf], [[1.0, 2.0]]])
def test_a_bad_sample_is_named(bad) -> None:
    with pytest.raises(ValueError, match="sample second: expected a row of finite numbers"):
        median_test({"first": [1.0, 2.0], "second": bad})


def test_one_sample_is_too_few() -> None:
    with pytest.raises(ValueError, match="expected at least two, got 1"):
        median_test({"only": [1.0]})


def test_holm_by_hand() -> None:
    # Ascending 0.01, 0.02, 0.03, 0.04 times 4, 3, 2, 1, never below the one before.
    assert holm([0.03, 0.01, 0.04, 0.02]) == pytest.approx((0.06, 0.04, 0.06, 0.06))
    assert holm([0.5, None, 0.9]) == (1.0, None, 1.0)
    assert holm([]) == ()
    with pytest.raises(ValueError, match="from 0 to 1"):
        holm([0.2, 1.2])


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_rejects_what_the_step_down_procedure_rejects(p_values: list[float]) -> None:
    """A second opinion: Holm's procedure as he gives it, one p-value after the other."""
    level, rejected = 0.05, set()
    for rank, place in enumerate(np.argsort(p_values, kind="stable")):
        if p_values[place] > level / (len(p_values) - rank):
            break
        rejected.add(int(place))
    adjusted = holm(p_values)
    assert {place for place, p in enumerate(adjusted) if p is not None and p <= level * (1 + 1e-12)} == rejected
