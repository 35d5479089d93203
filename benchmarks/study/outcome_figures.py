"""Distributions of the outcomes, and the questionnaire's scores beside them (thesis, figures 5.6 to 5.8)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from .outcomes_table import OUTCOMES, characters_of, letters_of, values_of
from .panels import ALGORITHM_COLOURS, CHARACTER_COLOURS, Bars, Boxes, Panel, PanelFigure, in_rows
from .questionnaire import PRINTED, QUESTIONS

if TYPE_CHECKING:
    import polars as pl

    from .outcomes_table import Outcome

# The measured outcomes that come closest to what each question asks for.
_NEAREST: Final = (("path_error_rms", "work_against"), ("time", "standing"), ("stops", "elbow_peak_qdd"))
_SHORT: Final = ("easy and natural", "satisfied by the time", "nothing unexpected")
_SCORES: Final = tuple(str(score) for score in range(1, 6))
_COLUMNS: Final = 3


def outcome_figure(trials: pl.DataFrame) -> PanelFigure:
    """Every outcome of every trial, by algorithm and character."""
    panels = [_boxes(trials, outcome, outcome.name) for outcome in OUTCOMES if _varies(trials, outcome.key)]
    same = [outcome for outcome in OUTCOMES if not _varies(trials, outcome.key)]
    left_out = "; ".join(f"{one.name} is {one.scale * trials[one.key][0]:g} {one.unit}".strip() for one in same)
    return PanelFigure(
        "outcomes",
        "Outcomes of all trials",
        "Every point is a trial; boxes hold the middle half, with the median. Smaller is better everywhere."
        + (f" Not drawn, as it is the same in all trials: {left_out}." if same else ""),
        in_rows(panels, _COLUMNS),
        row_height=270,
    )


def questionnaire_figure(trials: pl.DataFrame) -> PanelFigure:
    """Scores given by the thesis's subjects, and what the simulated operators' trials measured."""
    by_key = {outcome.key: outcome for outcome in OUTCOMES}
    rows = tuple(
        (
            Panel(
                f"Question {number + 1}: {_SHORT[number]}",
                "score",
                "subjects",
                tuple(
                    Bars(letter, _SCORES, tuple(map(float, PRINTED[letter][number])), ALGORITHM_COLOURS[letter])
                    for letter in PRINTED
                ),
            ),
            *(_by_algorithm(trials, by_key[key]) for key in keys),
        )
        for number, keys in enumerate(_NEAREST)
    )
    return PanelFigure(
        "questionnaire",
        "What people said, and what the simulation measured",
        f"Left, the {len(QUESTIONS)} questions as the thesis's 42 subjects scored them (1 worst, 5 best; one of A's "
        "rows lists 38 answers). Right, the measured outcomes that come closest to each question; they are no scores, "
        "and smaller is better.",
        rows,
        row_height=260,
    )


def _boxes(trials: pl.DataFrame, outcome: Outcome, title: str) -> Panel:
    letters = letters_of(trials)
    contents = tuple(
        Boxes(
            character,
            letters,
            tuple(
                _shown(outcome, values_of(trials, outcome.key, algorithm=letter, character=character))
                for letter in letters
            ),
            CHARACTER_COLOURS.get(character, "#555555"),
            character,
        )
        for character in characters_of(trials)
    )
    return Panel(title, "", outcome.unit or "count", contents, log_y=outcome.log)


def _by_algorithm(trials: pl.DataFrame, outcome: Outcome) -> Panel:
    contents = tuple(
        Boxes(
            letter,
            (letter,),
            (_shown(outcome, values_of(trials, outcome.key, algorithm=letter)),),
            ALGORITHM_COLOURS[letter],
            "all",
        )
        for letter in letters_of(trials)
    )
    return Panel(outcome.name, "", outcome.unit or "count", contents, log_y=outcome.log)


def _shown(outcome: Outcome, values: np.ndarray) -> np.ndarray:
    # A logarithm has no place for zero.
    return outcome.scale * (np.maximum(values, 1e-9) if outcome.log else values)


def _varies(trials: pl.DataFrame, key: str) -> bool:
    return trials[key].n_unique() > 1
