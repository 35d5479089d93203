"""Medians and tests of the simulated outcomes."""

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks.study import StudyResult
from kinqp.benchmarks.study.median_test import holm, median_test
from kinqp.benchmarks.study.outcomes_table import OUTCOMES, medians, operator_medians, outcome_tests
from kinqp.benchmarks.study.result import TRIAL_COLUMNS
from kinqp.benchmarks.study.words import count, number, p_value

NOTHING = "\N{EN DASH}"
TRIALS = pl.DataFrame(
    [
        {
            "algorithm": letter, "operator": operator, "character": "expert" if operator < 2 else "novice",
            "trial": trial, "time": base + 10.0 * operator + trial,
        }
        for letter, base in (("A", 0.0), ("B", 100.0))
        for operator in range(4)
        for trial in range(3)
    ]
)  # fmt: skip


def test_an_operator_counts_once() -> None:
    found = operator_medians(TRIALS, "time")
    # Trials 0, 1 and 2 add as many seconds: the middle one is each operator's median.
    assert found["A"].tolist() == [1.0, 11.0, 21.0, 31.0]
    assert found["B"].tolist() == [101.0, 111.0, 121.0, 131.0]


def test_rounding_is_no_difference() -> None:
    same = TRIALS.with_columns(time=pl.when(pl.col("algorithm") == "A").then(10.0).otherwise(10.0 + 1e-10))
    found = operator_medians(same, "time")
    assert median_test(found).statistic is None
    assert operator_medians(same.with_columns(pl.col("time") * 1.001), "time")["A"].tolist() == [10.01] * 4


def test_medians_with_intervals(study: StudyResult) -> None:
    found = {one.outcome.key: one.by for one in medians(study.trials)}
    assert set(found) == {one.key for one in OUTCOMES}
    for key, by in found.items():
        assert set(by) == {(letter, who) for letter in "ABC" for who in ("all", "expert", "novice")}
        for (letter, who), estimate in by.items():
            some = study.trials.filter(pl.col("algorithm") == letter)
            some = some if who == "all" else some.filter(pl.col("character") == who)
            values = np.sort(some[key].to_numpy().astype(float))
            # Of an even number, the lower of the two in the middle.
            assert estimate.value == values[(len(values) - 1) // 2]
            assert estimate.low <= estimate.value <= estimate.high
            assert values[0] <= estimate.low
            assert estimate.high <= values[-1]


def test_every_outcome_is_tested_together_and_in_pairs(study: StudyResult) -> None:
    found = outcome_tests(study.trials)
    assert [(one.outcome.key, one.letters) for one in found] == [
        (outcome.key, letters) for outcome in OUTCOMES for letters in ("ABC", "AB", "AC", "BC")
    ]
    by_operator = operator_medians(study.trials, "elbow_peak_qdd")
    one = next(one for one in found if (one.outcome.key, one.letters) == ("elbow_peak_qdd", "AC"))
    assert one.test == median_test({letter: by_operator[letter] for letter in "AC"})
    # All of A's peaks are above all of C's: with 8 and 8 operators chi-squared is 16, as by hand.
    assert one.test.above == (8, 0)
    assert one.test.statistic == pytest.approx(16.0)
    assert one.holm == holm([each.test.p_value for each in found])[found.index(one)]
    assert one.holm > one.test.p_value


def test_outcomes_are_columns() -> None:
    assert {outcome.key for outcome in OUTCOMES} <= set(TRIAL_COLUMNS)
    assert len({outcome.key for outcome in OUTCOMES}) == len(OUTCOMES)


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, NOTHING), (0.0, "0"), (3.0, "3"), (0.0123456, "0.0123"), (12.345, "12.3"), (999.6, "1000"),
     (1234.5, "1234"), (106823.0, "107,000"), (1.5e7, "1.50e+07"), (2e-5, "2.00e-05"), (-0.5, "-0.500")],
)  # fmt: skip
def test_numbers_have_three_digits(value: float | None, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(("value", "text"), [(None, NOTHING), (0.0474, "0.047"), (1.0, "1"), (2.69e-4, "2.7e-04")])
def test_p_values_have_two(value: float | None, text: str) -> None:
    assert p_value(value) == text


def test_one_is_singular() -> None:
    assert (count(1, "trial"), count(0, "trial"), count(3, "trial")) == ("1 trial", "0 trials", "3 trials")
