"""All that the page and the summary say of a study, computed once."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from .outcomes import standing_ticks
from .outcomes_table import Medians, OutcomeTest, medians, outcome_tests
from .pattern import Verdict, verdicts
from .plan import path_of
from .questionnaire_checks import QuestionnaireChecks, check_questionnaire

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from .result import StudyResult

    Array = NDArray[np.float64]

# Of the path that is drawn.
_PATH_POINTS: Final = 241


@dataclass(frozen=True)
class Findings:
    """A study and what follows from it.

    Attributes
    ----------
    study : StudyResult
    conditions : dict of str to str
        Under which it was run.
    path : ndarray, shape (N, 3)
        The wanted path [m].
    still : dict of str to ndarray of bool, shape (N,)
        Ticks of the representative trials at which the tool stands still although the hand pulls.
    medians : tuple of Medians
    tests : tuple of OutcomeTest
    verdicts : tuple of Verdict
    questionnaire : QuestionnaireChecks
        Of the thesis; the same in every study.
    """

    study: StudyResult
    conditions: dict[str, str]
    path: Array
    still: dict[str, NDArray[np.bool_]]
    medians: tuple[Medians, ...]
    tests: tuple[OutcomeTest, ...]
    verdicts: tuple[Verdict, ...]
    questionnaire: QuestionnaireChecks

    def summary(self) -> dict[str, Any]:
        """Verdicts, medians, tests and conditions, ready for JSON."""
        return {
            "conditions": self.conditions,
            "settings": asdict(self.study.settings),
            "verdicts": [asdict(one) for one in self.verdicts],
            "medians": {
                one.outcome.key: {
                    f"{letter} {character}": [estimate.value, estimate.low, estimate.high]
                    for (letter, character), estimate in one.by.items()
                }
                for one in self.medians
            },
            "tests": [
                {
                    "outcome": one.outcome.key, "algorithms": one.letters, "medians": one.medians,
                    "chi2": one.test.statistic, "p": one.test.p_value, "p_holm": one.holm,
                }
                for one in self.tests
            ],
            "thesis": [
                {
                    "algorithms": one.pair, "question": one.question + 1, "chi2": one.test.statistic,
                    "p": one.test.p_value, "p_holm": one.holm, "chi2_42_answers": one.completed,
                    "printed": one.printed, "comes_out": one.said,
                }
                for one in self.questionnaire.comparisons
            ],
        }  # fmt: skip


def analyse(study: StudyResult, conditions: Mapping[str, str]) -> Findings:
    """Compute all that is said of a study."""
    tests, path = outcome_tests(study.trials), path_of(study.settings)
    return Findings(
        study=study,
        conditions=dict(conditions),
        path=np.array([path.point(s) for s in np.linspace(0.0, path.length, _PATH_POINTS)]),
        still={letter: standing_ticks(run) for letter, run in study.runs.items()},
        medians=medians(study.trials),
        tests=tests,
        verdicts=verdicts(study, tests),
        questionnaire=check_questionnaire(),
    )
