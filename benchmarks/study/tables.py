"""Rows of the page's tables: numbers in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .outcomes_table import characters_of, letters_of
from .questionnaire import PRINTED_P_TEXT, PRINTED_PREFER_C, SUBJECTS
from .words import NOTHING, number, p_value, two_decimals

if TYPE_CHECKING:
    from collections.abc import Sequence

    import polars as pl

    from ..metrics.intervals import Estimate
    from .outcomes_table import Medians, OutcomeTest
    from .questionnaire_checks import Comparison, QuestionnaireChecks
    from .result import StudyResult


def median_rows(found: Sequence[Medians], trials: pl.DataFrame) -> tuple[list[str], list[dict[str, Any]]]:
    """Heads and rows of the medians: all operators by algorithm, then each character."""
    columns = [(letter, character) for character in ("all", *characters_of(trials)) for letter in letters_of(trials)]
    heads = [letter if character == "all" else f"{letter}, {character}" for letter, character in columns]

    def cell(estimate: Estimate | None, scale: float) -> dict[str, str]:
        if estimate is None or estimate.value is None or estimate.low is None or estimate.high is None:
            return {"value": NOTHING, "interval": ""}
        same = estimate.low == estimate.high
        interval = "" if same else f"{number(scale * estimate.low)} to {number(scale * estimate.high)}"
        return {"value": number(scale * estimate.value), "interval": interval}

    rows = [
        {"name": one.outcome.label, "cells": [cell(one.by.get(key), one.outcome.scale) for key in columns]}
        for one in found
    ]
    return heads, rows


def test_rows(found: Sequence[OutcomeTest], level: float) -> tuple[list[str], list[dict[str, Any]]]:
    """Heads and rows of the median tests, a column for each group of algorithms."""
    groups = list(dict.fromkeys(one.letters for one in found))
    heads = [" and ".join(group) if len(group) == 2 else f"all {len(group)}" for group in groups]
    rows: dict[str, dict[str, Any]] = {}
    for one in found:
        row = rows.setdefault(one.outcome.key, {"name": one.outcome.label, "cells": []})
        rough = "*" if one.test.p_value is not None and one.test.smallest_expected < 5.0 else ""
        text = NOTHING if one.test.statistic is None else f"{one.test.statistic:.2f}, {p_value(one.holm)}{rough}"
        row["cells"].append({"text": text, "sure": one.holm is not None and one.holm < level})
    return heads, list(rows.values())


def extreme_rows(found: StudyResult) -> list[dict[str, Any]]:
    """Largest velocity, acceleration and torque of each joint in the trials shown, beside the limits."""
    settings, rows = found.settings, []
    kinds = (
        ("velocity", "rad/s", lambda _, run: run.qd, settings.qd_max),
        ("acceleration", "rad/s²", lambda _, run: run.acceleration(), settings.qdd_max),
        ("torque", "Nm", lambda letter, _: found.torques[letter], settings.tau_max),
    )
    for name, unit, values, limits in kinds:
        largest = [np.max(np.abs(values(letter, run)), axis=0) for letter, run in found.runs.items()]
        for joint, limit in enumerate(limits):
            cells = [
                {"text": number(float(one[joint])), "bad": bool(one[joint] > limit * (1 + 1e-6))} for one in largest
            ]
            label = f"joint {joint + 1}: {name} [{unit}]"
            rows.append({"name": label, "cells": cells, "limit": number(limit) if np.isfinite(limit) else NOTHING})
    return rows


def thesis_rows(checks: QuestionnaireChecks) -> list[dict[str, str]]:
    """Each comparison of the thesis beside what its tables give."""
    return [_thesis_row(one) for one in checks.comparisons]


def _thesis_row(one: Comparison) -> dict[str, str]:
    printed = f"{one.printed:.2f}, {PRINTED_P_TEXT[one.question]}" if one.printed is not None else "> 25"
    kind, said = {True: ("yes", "yes"), False: ("no", "no"), None: ("unknown", "depends")}[one.said]
    p = p_value(one.test.p_value) if one.completed_p is None else _range(*one.completed_p, p_value)
    return {
        "pair": f"{one.pair[0]} and {one.pair[1]}",
        "question": str(one.question + 1),
        "listed": two_decimals(one.test.statistic),
        "completed": "" if one.completed is None else _range(*one.completed, two_decimals),
        "p": p,
        "holm": p_value(one.holm),
        "printed": printed,
        "said": said,
        "kind": kind,
    }


def _range(low: float, high: float, text: Any) -> str:
    return str(text(low)) if text(low) == text(high) else f"{text(low)} to {text(high)}"


def thesis_notes(checks: QuestionnaireChecks) -> list[str]:
    """Where what the thesis prints is off, and what reproduces it."""
    completion = checks.completion
    short = next(one for one in checks.comparisons if one.printed is not None and one.completed is not None)
    fives = "; ".join(f"{count} of them: {value:.2f}" for count, value in completion.by_fives[1:])
    columns = ", ".join(f"{value:.3f} at {p:g}" for p, value in checks.columns)
    off = [one for one in checks.comparisons if one.printed is None and one.said is False]
    open_ = [one for one in checks.comparisons if one.printed is None and one.said is None]
    notes = [
        f"Question 3 of algorithm A lists {SUBJECTS - completion.missing} answers of {SUBJECTS}. As listed they give "
        f"{two_decimals(short.test.statistic)}, not {two_decimals(short.printed)}. The printed value comes out when "
        f"none of the {completion.missing} missing answers is a 5, whatever they are otherwise: in "
        f"{len(completion.reproducing)} of the {completion.tried} ways to complete the row. With a 5 among them it "
        f"would be less ({fives}).",
        "The printed p-values are columns of a table of critical values rather than p-values: chi-squared is "
        f"{columns}. So “p ≈ 0.005” reads p < 0.005, and “p = 0.25” reads p > 0.25; the values themselves are in the "
        "table above. No verdict at 5 % changes.",
    ]
    notes += [
        f"B is said to have more than 25 in every comparison; question {one.question + 1} of "
        f"{one.pair[0]} and {one.pair[1]} has {two_decimals(one.test.statistic)}."
        for one in off
    ]
    notes += [
        f"For question {one.question + 1} of {one.pair[0]} and {one.pair[1]} it depends on the missing answers, which "
        f"move the pooled median: {two_decimals(one.completed[0])} to {two_decimals(one.completed[1])}; "
        f"{two_decimals(one.test.statistic)} with the answers listed."
        for one in open_
        if one.completed is not None
    ]
    significant = sum(one.holm is not None and one.holm < 0.05 for one in checks.comparisons)
    notes += [
        f"Nine tests are made without correction. With Holm's, the same {significant} of them stay below 0.05.",
        "Each subject scored all three algorithms; the median test takes the scores for independent ones, and does not "
        "use the pairing.",
        f"{100 * PRINTED_PREFER_C:.0f} % ranked C first (32 of {SUBJECTS}); the counts of figure 5.9 are not printed, "
        "so they are not drawn here.",
    ]
    return notes
