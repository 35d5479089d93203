"""What a reader must know before believing the study's page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import polars as pl

if TYPE_CHECKING:
    from .result import StudyResult

_ALWAYS: Final = (
    "No people took part. Operators are simulated hands: a spring and a damper with a ceiling to the force, tremor, "
    "and a rule for what to do when the tool does not follow. Their characters are this project's; nothing was fitted "
    "to the thesis's subjects, whose single trials are not printed.",
    "Operators differ by what is drawn for them, so that p-values and intervals speak of other draws of the same "
    "hands, not of other people.",
    "The arm follows its commands exactly: no flexible joints, no drives, no delay, no friction. Torques are what such "
    "motion would ask for; real ones would be smoothed by the drives, and so would the peaks of A.",
    "The thesis gives no measures of path, hand or arm's limits of acceleration. Radius, start and 10 rad/s² are this "
    "project's; KUKA publishes no accelerations. The thesis's accelerations of C, of the order of 10⁻³ rad/s², can "
    "therefore not be compared with those here: what carries over is that C keeps its limit and A does not.",
    "A bounded acceleration is promised on the way into a limit only. Anywhere else accelerations are the hand's, as "
    "the admittance passes them on.",
    "The outcomes beside the questionnaire are measurements, not scores: how people would rate them is unknown.",
    "Curves are thinned to the smallest and largest value of each stretch of the run: no spike is lost.",
)


def limitations(found: StudyResult) -> list[str]:
    """Limitations of any study, then those of this one."""
    told = list(_ALWAYS)
    settings, trials = found.settings, found.trials
    unfinished = trials.filter(~pl.col("finished"))
    if unfinished.height:
        by = unfinished.group_by("algorithm").len().sort("algorithm")
        counted = ", ".join(f"{count} of {letter}" for letter, count in by.iter_rows())
        told.append(
            f"{unfinished.height} trials were ended after {settings.time_limit:g} s, without having arrived: {counted}."
            " Their time is that limit: medians are right as long as fewer than half are of this kind."
        )
    unsolved = int(trials["unsolved"].sum())
    if unsolved:
        told.append(f"At {unsolved} ticks no answer was found and the safe stop was sent.")
    if settings.operators < 20:
        told.append(f"Only {settings.operators} operators: intervals are wide, and tests find little.")
    return told
