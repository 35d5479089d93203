"""The simulated outcomes in numbers: medians with intervals, and the median tests between the algorithms."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np
import polars as pl

from ..metrics.intervals import Estimate, percentiles
from .median_test import MedianTest, holm, median_test

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_DIGITS: Final = 6


@dataclass(frozen=True)
class Outcome:
    """A measure of a trial.

    Attributes
    ----------
    key : str
        Column of `StudyResult.trials`.
    name, unit : str
    log : bool
        Whether it is shown as a logarithm.
    scale : float
        Of the unit that it is shown in, to that of the column.
    """

    key: str
    name: str
    unit: str
    log: bool = False
    scale: float = 1.0

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


#: All that a trial is judged by; smaller is better for each.
OUTCOMES: Final = (
    Outcome("time", "time to finish", "s"),
    Outcome("stops", "stops", ""),
    Outcome("standing", "standing still", "s"),
    Outcome("path_error_rms", "distance from the path, RMS", "mm", scale=1e3),
    Outcome("work_against", "work against the hand", "J"),
    Outcome("elbow_peak_qdd", "elbow acceleration, peak", "rad/s²", log=True),
    Outcome("peak_qdd", "acceleration of any joint, peak", "rad/s²", log=True),
    Outcome("rms_qdd", "acceleration, RMS", "rad/s²", log=True),
    Outcome("peak_torque", "torque of any joint, peak", "Nm"),
    Outcome("rms_torque", "torque, RMS", "Nm"),
    Outcome("peak_torque_rate", "rate of torque, peak", "Nm/s", log=True),
    Outcome("unexpected", "ticks of unexpected motion", ""),
    Outcome("drift_mm", "drift of the locked rows", "mm"),
    Outcome("drift_deg", "drift of the locked rows", "°"),
)


@dataclass(frozen=True)
class Medians:
    """Medians of one outcome.

    Attributes
    ----------
    outcome : Outcome
    by : dict of (str, str) to Estimate
        Algorithm and character ("all" for both) to the median over trials, with the interval that other operators
        of the same characters would leave it in.
    """

    outcome: Outcome
    by: dict[tuple[str, str], Estimate]


@dataclass(frozen=True)
class OutcomeTest:
    """Algorithms compared on one outcome.

    Attributes
    ----------
    outcome : Outcome
    letters : str
        As "AC"; all of them where they are tested together.
    test : MedianTest
        Of the operators' medians over their trials: trials of one operator are not independent of one another.
    medians : dict of str to float
        Of these, by algorithm.
    holm : float or None
        The p-value adjusted for all tests of the study.
    """

    outcome: Outcome
    letters: str
    test: MedianTest
    medians: dict[str, float]
    holm: float | None


def letters_of(trials: pl.DataFrame) -> tuple[str, ...]:
    """Algorithms of a study, in order."""
    return tuple(sorted(trials["algorithm"].unique()))


def characters_of(trials: pl.DataFrame) -> tuple[str, ...]:
    """Characters of a study, in order."""
    return tuple(sorted(trials["character"].unique()))


def values_of(trials: pl.DataFrame, key: str, **chosen: str) -> Array:
    """Values of an outcome, shape (N,), of the trials with such entries in other columns."""
    some = trials.filter(*(pl.col(name) == value for name, value in chosen.items()))
    values: Array = some[key].cast(pl.Float64).to_numpy()
    return values


def operator_medians(trials: pl.DataFrame, key: str) -> dict[str, Array]:
    """Median of each operator's trials, shape (operators,), by algorithm; to six digits.

    Algorithms that keep the same limit differ in the tenth digit, by rounding, which a test of ranks would call a
    difference.
    """
    middle = pl.col(key).cast(pl.Float64).median().round_sig_figs(_DIGITS)
    found = trials.group_by("algorithm", "operator").agg(middle).sort("algorithm", "operator")
    return {letter: values_of(found, key, algorithm=letter) for letter in letters_of(trials)}


def medians(trials: pl.DataFrame) -> tuple[Medians, ...]:
    """Medians of all outcomes, with intervals by drawing operators again, each with all their trials."""
    found = []
    for outcome in OUTCOMES:
        by = {}
        for letter in letters_of(trials):
            for character in ("all", *characters_of(trials)):
                some = trials.filter(pl.col("algorithm") == letter)
                if character != "all":
                    some = some.filter(pl.col("character") == character)
                if not some.height:
                    continue
                _, cluster = np.unique(some["operator"].to_numpy(), return_inverse=True)
                by[letter, character] = percentiles(values_of(some, outcome.key), cluster, (50.0,))[0]
        found.append(Medians(outcome, by))
    return tuple(found)


def outcome_tests(trials: pl.DataFrame) -> tuple[OutcomeTest, ...]:
    """Mood's median test of every outcome: all algorithms together, then each two; Holm's correction over all."""
    letters = letters_of(trials)
    groups = [letters, *combinations(letters, 2)] if len(letters) > 2 else [letters]
    made = []
    for outcome in OUTCOMES:
        samples = operator_medians(trials, outcome.key)
        middle = {letter: float(np.median(values)) for letter, values in samples.items()}
        for group in groups:
            test = median_test({letter: samples[letter] for letter in group})
            made.append((outcome, "".join(group), test, {letter: middle[letter] for letter in group}))
    adjusted = holm([test.p_value for _, _, test, _ in made])
    return tuple(OutcomeTest(*one, p) for one, p in zip(made, adjusted, strict=True))
