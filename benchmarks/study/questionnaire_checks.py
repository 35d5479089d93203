"""The thesis's statistics on its questionnaire (section 5.4.1), computed again from its tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from scipy import stats

from .median_test import MedianTest, holm, median_test
from .questionnaire import (
    LEVEL,
    PRINTED,
    PRINTED_B_ABOVE,
    PRINTED_CHI2,
    PRINTED_P,
    QUESTIONS,
    SUBJECTS,
    answers,
    completions,
)

#: The one row that lists fewer answers than there were subjects: algorithm and question (from 0).
SHORT_ROW: Final = ("A", 2)
_PAIRS: Final = ("AC", "AB", "BC")


@dataclass(frozen=True)
class Completion:
    """What the short row gives against C, depending on what the answers that it does not list were.

    Attributes
    ----------
    missing : int
        Answers that are not listed.
    by_fives : tuple of (int, float)
        For each number of missing answers that were a 5, the chi-squared, whatever the others were.
    reproducing : tuple of tuple of int
        Completed rows that give the printed value to its digits.
    tried : int
        Completed rows in all.
    """

    missing: int
    by_fives: tuple[tuple[int, float], ...]
    reproducing: tuple[tuple[int, ...], ...]
    tried: int


@dataclass(frozen=True)
class Comparison:
    """Two algorithms compared on one question.

    Attributes
    ----------
    pair : str
        As "AC".
    question : int
        From 0.
    test : MedianTest
        On the answers that are listed.
    corrected : float or None
        Its statistic with Yates' correction, which the thesis does not apply.
    holm : float or None
        Its p-value adjusted for all nine comparisons.
    completed : tuple of (float, float) or None
        Smallest and largest statistic over the completions that reproduce the printed value of A against C; None where
        no answer is missing.
    completed_p : tuple of (float, float) or None
        Their p-values.
    printed, printed_p : float or None
        What is printed; None where the thesis says only that chi-squared is above 25.
    said : bool or None
        Whether what the thesis says comes out (with the missing answers where there are such); None where that depends
        on what these were.
    """

    pair: str
    question: int
    test: MedianTest
    corrected: float | None
    holm: float | None
    completed: tuple[float, float] | None
    completed_p: tuple[float, float] | None
    printed: float | None
    printed_p: float | None
    said: bool | None


@dataclass(frozen=True)
class QuestionnaireChecks:
    """All of section 5.4.1.

    Attributes
    ----------
    comparisons : tuple of Comparison
        A against C, A against B, B against C, each for three questions.
    completion : Completion
        Of question 3 of algorithm A.
    critical : float
        Of chi-squared with one degree of freedom at 5 %.
    columns : tuple of (float, float)
        Chi-squared at the printed p-values, as a printed table of critical values has them: (p, chi-squared).
    """

    comparisons: tuple[Comparison, ...]
    completion: Completion
    critical: float
    columns: tuple[tuple[float, float], ...]


def check_questionnaire() -> QuestionnaireChecks:
    """Compute section 5.4.1 again from tables 5.3 to 5.5."""
    completion = _complete()
    places = [(pair, question) for pair in _PAIRS for question in range(len(QUESTIONS))]
    tests = [_test(pair, question, PRINTED["A"][question]) for pair, question in places]
    adjusted = holm([test.p_value for test in tests])
    comparisons = tuple(
        _compare(pair, question, test, p, completion)
        for (pair, question), test, p in zip(places, tests, adjusted, strict=True)
    )
    columns = tuple((p, float(stats.chi2.isf(p, 1))) for p in sorted(set(PRINTED_P)))
    return QuestionnaireChecks(comparisons, completion, float(stats.chi2.isf(LEVEL, 1)), columns)


def _test(pair: str, question: int, of_a: tuple[int, ...], *, correction: bool = False) -> MedianTest:
    """Compare two algorithms with A's row as given."""
    rows = {letter: of_a if letter == "A" else PRINTED[letter][question] for letter in pair}
    return median_test({letter: answers(row) for letter, row in rows.items()}, correction=correction)


def _compare(pair: str, question: int, test: MedianTest, adjusted: float | None, completion: Completion) -> Comparison:
    corrected = _test(pair, question, PRINTED["A"][question], correction=True).statistic
    values, p_values = [test.statistic or 0.0], [test.p_value or 1.0]
    short = question == SHORT_ROW[1] and SHORT_ROW[0] in pair
    if short:
        found = [_test(pair, question, row) for row in completion.reproducing]
        values = sorted(one.statistic or 0.0 for one in found)
        p_values = sorted(one.p_value or 1.0 for one in found)
    printed = PRINTED_CHI2[question] if pair == "AC" else None
    holds = {round(one, 2) == printed if printed is not None else one > PRINTED_B_ABOVE for one in values}
    return Comparison(
        pair,
        question,
        test,
        corrected,
        adjusted,
        (values[0], values[-1]) if short else None,
        (p_values[0], p_values[-1]) if short else None,
        printed,
        PRINTED_P[question] if pair == "AC" else None,
        holds.pop() if len(holds) == 1 else None,
    )


def _complete() -> Completion:
    name, question = SHORT_ROW
    row = PRINTED[name][question]
    values: dict[int, set[float]] = {}
    reproducing, tried = [], 0
    for counts in completions(row, SUBJECTS):
        tried += 1
        statistic = _test("AC", question, counts).statistic or 0.0
        values.setdefault(counts[-1] - row[-1], set()).add(statistic)
        if round(statistic, 2) == PRINTED_CHI2[question]:
            reproducing.append(counts)
    by_fives = tuple((fives, min(some)) for fives, some in sorted(values.items()) if len(some) == 1)
    return Completion(SUBJECTS - sum(row), by_fives, tuple(reproducing), tried)
