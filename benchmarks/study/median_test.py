"""Mood's median test, and Holm's correction for testing many times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class MedianTest:
    """What the test found.

    Attributes
    ----------
    names : tuple of str
        Of the samples.
    median : float
        Of all values together.
    above, rest : tuple of int
        For each sample, how many values are strictly above that median, and how many are not.
    statistic : float or None
        Pearson's chi-squared of these counts; None where no value is above the median, as then nothing is split.
    p_value : float or None
        Of the statistic, at one degree of freedom less than there are samples.
    smallest_expected : float
        Smallest count that is expected where the samples have one median; below 5 the p-value is a rough one.
    """

    names: tuple[str, ...]
    median: float
    above: tuple[int, ...]
    rest: tuple[int, ...]
    statistic: float | None
    p_value: float | None
    smallest_expected: float


def median_test(samples: Mapping[str, ArrayLike], *, correction: bool = False) -> MedianTest:
    """Test whether samples come from populations with one median (Mood; thesis, section 5.4.1).

    The counts above the common median are compared as the thesis compares them, which its printed values tell: values
    that equal the median count as not above it, and Yates' continuity correction is not applied.

    Parameters
    ----------
    samples : mapping of str to array_like, shape (N,)
        At least two, by their names. The test takes all values for independent.
    correction : bool
        Apply Yates' continuity correction (two samples only; with more there is none).

    Returns
    -------
    MedianTest

    Raises
    ------
    ValueError
        Naming a sample that is empty, not a row of numbers or not finite; or when there are fewer than two.
    """
    if len(samples) < 2:
        raise ValueError(f"samples: expected at least two, got {len(samples)}")
    rows = {name: np.asarray(values, dtype=np.float64) for name, values in samples.items()}
    for name, row in rows.items():
        if row.ndim != 1 or not row.size or not np.isfinite(row).all():
            raise ValueError(f"sample {name}: expected a row of finite numbers, got {row!r}")
    median = float(np.median(np.concatenate(list(rows.values()))))
    above = tuple(int(np.count_nonzero(row > median)) for row in rows.values())
    rest = tuple(len(row) - count for row, count in zip(rows.values(), above, strict=True))
    expected = stats.contingency.expected_freq(np.array([above, rest]))
    statistic = p_value = None
    # scipy refuses a table with a row of zeros.
    if any(above):
        found = stats.median_test(*rows.values(), ties="below", correction=correction)
        statistic, p_value = float(found.statistic), float(found.pvalue)
    return MedianTest(tuple(rows), median, above, rest, statistic, p_value, float(expected.min()))


def holm(p_values: Sequence[float | None]) -> tuple[float | None, ...]:
    """Adjust p-values such that the chance of even one false alarm among them stays at the level (Holm, 1979).

    Parameters
    ----------
    p_values : sequence of float or None
        None stands for a test that could not be made; it is not counted, and stays None.

    Returns
    -------
    tuple of float or None
        In the same order, at most 1.

    Raises
    ------
    ValueError
        When one is not between 0 and 1.
    """
    made = [(p, place) for place, p in enumerate(p_values) if p is not None]
    if any(not 0.0 <= p <= 1.0 for p, _ in made):
        raise ValueError(f"p_values: expected numbers from 0 to 1, got {list(p_values)}")
    adjusted: list[float | None] = [None] * len(p_values)
    so_far = 0.0
    for rank, (p, place) in enumerate(sorted(made)):
        so_far = max(so_far, min(1.0, (len(made) - rank) * p))
        adjusted[place] = so_far
    return tuple(adjusted)
