"""The usability questionnaire of the thesis as printed: A. Spinoglio, Politecnico di Milano and KUKA, 2018."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

#: The algorithms compared (section 5.1), by the letters of section 5.3.
TITLES: Final = {
    "A": "task priority, the original with its hard stop",
    "B": "saturation in the null space",
    "C": "the QP",
}


@dataclass(frozen=True)
class Question:
    """One question scored from 1 to 5 (section 5.2, appendix B).

    Attributes
    ----------
    text : str
        As asked in section 5.2.
    worst, best : str
        What the scores 1 and 5 stand for.
    """

    text: str
    worst: str
    best: str


QUESTIONS: Final = (
    Question(
        "It was easy and natural to perform the required task (trajectory following)",
        "very difficult",
        "very easy/natural",
    ),
    Question(
        "I'm satisfied by the amount of time required to perform the task",
        "much longer than expected",
        "faster than expected",
    ),
    Question(
        "I didn't notice any unexpected movements/stop of the robot (abrupt movements or waving)",
        "a lot of unexpected movements",
        "no unexpected movements",
    ),
)

#: Tables 5.3 to 5.5: for each algorithm and question, how many of the subjects gave the scores 1 to 5.
PRINTED: Final = {
    "A": ((0, 2, 17, 19, 4), (0, 5, 18, 14, 5), (0, 3, 15, 13, 7)),
    "B": ((19, 18, 4, 1, 0), (16, 17, 9, 0, 0), (28, 10, 2, 2, 0)),
    "C": ((0, 1, 9, 17, 15), (0, 4, 15, 17, 6), (0, 1, 5, 13, 23)),
}
#: Table 5.1.
SUBJECTS: Final = 42

#: Section 5.4.1: chi-squared and p of A against C for each question, and the critical value at 5 %.
PRINTED_CHI2: Final = (8.23, 0.76, 13.27)
PRINTED_P: Final = (0.005, 0.25, 0.005)
PRINTED_P_TEXT: Final = ("p ≈ 0.005", "p = 0.25", "p ≈ 0.005")
PRINTED_CRITICAL: Final = 3.841
LEVEL: Final = 0.05
#: Section 5.4.1: "always produced very high chi-squared > 25 values in every comparison", said of B.
PRINTED_B_ABOVE: Final = 25.0
#: Section 5.4.1: share of the subjects who ranked C first. The counts of figure 5.9 are not printed.
PRINTED_PREFER_C: Final = 0.76


def answers(counts: Sequence[int]) -> NDArray[np.int64]:
    """Single answers of a row of a table.

    Parameters
    ----------
    counts : sequence of 5 int
        How often each score from 1 to 5 was given.

    Returns
    -------
    ndarray of int, shape (sum of counts,)
        Scores, ascending.

    Raises
    ------
    ValueError
        When there are not five counts, or one is negative.
    """
    if len(counts) != 5 or min(counts) < 0:
        raise ValueError(f"counts: expected five numbers of at least 0, got {tuple(counts)}")
    return np.repeat(np.arange(1, 6), counts)


def completions(counts: Sequence[int], total: int = SUBJECTS) -> Iterator[tuple[int, ...]]:
    """All rows that a row can have been with `total` answers: those that the missing answers can be spread to.

    Parameters
    ----------
    counts : sequence of 5 int
    total : int
        Answers in all.

    Raises
    ------
    ValueError
        When the row has more answers than that.
    """
    missing = total - len(answers(counts))
    if missing < 0:
        raise ValueError(f"total: expected at least the {sum(counts)} answers listed, got {total}")
    yield from _spread(tuple(counts), missing)


def _spread(counts: tuple[int, ...], missing: int) -> Iterator[tuple[int, ...]]:
    if len(counts) == 1:
        yield (counts[0] + missing,)
        return
    for here in range(missing + 1):
        for rest in _spread(counts[1:], missing - here):
            yield (counts[0] + here, *rest)
