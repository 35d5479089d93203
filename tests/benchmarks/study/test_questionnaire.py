"""The thesis's chi-squared values from its tables, to the printed digits."""

import math
from pathlib import Path

import pytest
from scipy import stats

from kinqp.benchmarks.study.median_test import median_test
from kinqp.benchmarks.study.questionnaire import (
    PRINTED,
    PRINTED_CHI2,
    PRINTED_CRITICAL,
    PRINTED_PREFER_C,
    QUESTIONS,
    SUBJECTS,
    answers,
    completions,
)
from kinqp.benchmarks.study.questionnaire_checks import SHORT_ROW, QuestionnaireChecks, check_questionnaire


@pytest.fixture(scope="module")
def checks() -> QuestionnaireChecks:
    return check_questionnaire()


def test_one_row_of_the_tables_lists_38_answers_and_all_others_42() -> None:
    short = [
        (letter, question, sum(row))
        for letter, rows in PRINTED.items()
        for question, row in enumerate(rows)
        if sum(row) != SUBJECTS
    ]
    assert short == [(*SHORT_ROW, 38)]
    assert len(QUESTIONS) == 3


def test_the_printed_values_come_out(checks: QuestionnaireChecks) -> None:
    first, second, third = checks.comparisons[:3]
    assert [one.pair for one in (first, second, third)] == ["AC"] * 3
    # Above the pooled median: 4 of 42 and 15 of 42; 19 and 23; 7 of 42 and 23 of 42.
    assert (first.test.median, first.test.above) == (4.0, (4, 15))
    assert (second.test.median, second.test.above) == (3.5, (19, 23))
    assert (third.test.median, third.test.above) == (4.0, (7, 23))
    assert f"{first.test.statistic:.2f}" == "8.23"
    assert f"{second.test.statistic:.2f}" == "0.76"
    assert third.completed is not None
    assert [f"{value:.2f}" for value in third.completed] == ["13.27", "13.27"]
    assert all(one.said for one in (first, second, third))
    # As rational numbers: N (ad - bc)^2 over the products of the sums.
    assert first.test.statistic == pytest.approx(84 * (4 * 27 - 15 * 38) ** 2 / (19 * 65 * 42 * 42))
    assert third.completed[0] == pytest.approx(84 * (7 * 19 - 23 * 35) ** 2 / (30 * 54 * 42 * 42))


def test_the_38_printed_answers_give_another_value(checks: QuestionnaireChecks) -> None:
    third = checks.comparisons[2]
    assert f"{third.test.statistic:.2f}" == "11.24"
    assert third.test.rest == (31, 19)


def test_with_yates_correction_none_of_them_would_come_out(checks: QuestionnaireChecks) -> None:
    corrected = [round(one.corrected, 2) for one in checks.comparisons[:3]]
    assert corrected == [6.80, 0.43, 9.74]


def test_the_missing_answers_were_no_fives(checks: QuestionnaireChecks) -> None:
    completion = checks.completion
    assert completion.missing == 4
    # Four alike things into five boxes, and into four.
    assert completion.tried == math.comb(8, 4)
    assert len(completion.reproducing) == math.comb(7, 3)
    assert all(row[4] == PRINTED["A"][2][4] and sum(row) == SUBJECTS for row in completion.reproducing)
    assert [fives for fives, _ in completion.by_fives] == [0, 1, 2, 3, 4]
    assert [round(value, 2) for _, value in completion.by_fives] == [13.27, 11.50, 9.89, 8.43, 7.12]


def test_b_is_above_25_in_all_comparisons_but_one_and_perhaps_another(checks: QuestionnaireChecks) -> None:
    others = {(one.pair, one.question): one for one in checks.comparisons[3:]}
    assert {key: round(one.test.statistic, 2) for key, one in others.items()} == {
        ("AB", 0): 28.23, ("AB", 1): 24.55, ("AB", 2): 54.46, ("BC", 0): 47.96, ("BC", 1): 31.67, ("BC", 2): 55.55,
    }  # fmt: skip
    assert {key for key, one in others.items() if one.said is False} == {("AB", 1)}
    # The missing answers of A move the pooled median of A and B, so that this one depends on what they were.
    assert {key for key, one in others.items() if one.said is None} == {("AB", 2)}
    assert [round(value, 2) for value in others["AB", 2].completed] == [19.95, 55.05]


def test_printed_p_values_are_columns_of_a_table_rather_than_p_values(checks: QuestionnaireChecks) -> None:
    assert checks.critical == pytest.approx(PRINTED_CRITICAL, abs=5e-4)
    first, second, third = checks.comparisons[:3]
    assert first.test.p_value == pytest.approx(0.00412, abs=5e-6)
    assert second.test.p_value == pytest.approx(0.383, abs=5e-4)
    assert third.completed_p == pytest.approx((0.000269, 0.000269), abs=5e-7)
    assert [(p, round(value, 3)) for p, value in checks.columns] == [(0.005, 7.879), (0.25, 1.323)]
    # 8.23 and 13.27 are beyond the column 0.005, 0.76 is short of the column 0.25: as bounds what is printed is right.
    assert PRINTED_CHI2[0] > 7.879 < PRINTED_CHI2[2]
    assert PRINTED_CHI2[1] < 1.323


def test_holm_leaves_all_verdicts_at_five_per_cent(checks: QuestionnaireChecks) -> None:
    significant = [(one.pair, one.question) for one in checks.comparisons if one.holm < 0.05]
    assert set(significant) == {(one.pair, one.question) for one in checks.comparisons} - {("AC", 1)}


def test_a_second_opinion_on_a_and_c() -> None:
    """The same by scipy's contingency test on counts taken from the tables by hand."""
    for question, above in enumerate(((4, 15), (19, 23), (7, 23))):
        table = [above, (42 - above[0], 42 - above[1])]
        statistic = stats.chi2_contingency(table, correction=False).statistic
        assert round(statistic, 2) == PRINTED_CHI2[question]


def test_three_in_four_prefer_c() -> None:
    assert round(32 / SUBJECTS, 2) == PRINTED_PREFER_C


def test_answers_and_completions() -> None:
    assert answers((1, 0, 2, 0, 1)).tolist() == [1, 3, 3, 5]
    assert list(completions((0, 0, 0, 0, 1), 2)) == [
        (0, 0, 0, 0, 2), (0, 0, 0, 1, 1), (0, 0, 1, 0, 1), (0, 1, 0, 0, 1), (1, 0, 0, 0, 1),
    ]  # fmt: skip
    with pytest.raises(ValueError, match="five numbers"):
        answers((1, 2))
    with pytest.raises(ValueError, match="at least the 2 answers"):
        list(completions((2, 0, 0, 0, 0), 1))


def test_completions_do_not_move_c(checks: QuestionnaireChecks) -> None:
    for row in checks.completion.reproducing[::7]:
        found = median_test({"A": answers(row), "C": answers(PRINTED["C"][2])})
        assert found.above == (7, 23)


def test_the_document_says_what_comes_out(checks: QuestionnaireChecks) -> None:
    page = (Path(__file__).parents[3] / "docs" / "study.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines()]
    for one in checks.comparisons:
        if one.printed is None:
            assert f"{one.test.statistic:.2f}" in page, one
            continue
        (row,) = (row for row in rows if row and row[0].startswith(f"{one.question + 1}, "))
        value = one.completed[0] if one.completed else one.test.statistic
        assert row[1].startswith(f"{one.printed:.2f}, ")
        assert row[2].startswith(f"{value:.2f}")
        assert float(row[3].split()[0]) == pytest.approx(
            one.completed_p[0] if one.completed_p else one.test.p_value, rel=0.02
        )
        assert f"{one.corrected:.2f}" in row[4]
    for _, value in checks.completion.by_fives:
        assert f"{value:.2f}" in page
    low, high = next(one.completed for one in checks.comparisons if one.said is None)
    assert f"from {low:.2f} to {high:.2f}" in page
