"""The study as one HTML page that loads nothing."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from .. import report
from . import tables
from .animation import animation
from .limitations import limitations
from .motion_figures import elbow_figure, elbow_phase_figure, joint_figure
from .outcome_figures import outcome_figure, questionnaire_figure
from .panels import ALGORITHM_COLOURS
from .panels_plotly import to_plotly
from .pattern import LEVEL
from .words import NOTHING, count, number, two_decimals

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from .findings import Findings
    from .panels import PanelFigure
    from .pattern import Verdict
    from .result import StudySettings

_SCRIPTS: Final = ("scene.js", "animation.js")


def figures(found: Findings) -> dict[str, tuple[PanelFigure, ...]]:
    """All figures of panels, by the section of the page that they are in."""
    study = found.study
    return {
        "elbow": (elbow_figure(study), elbow_phase_figure(study)),
        "joints": (joint_figure(study),),
        "outcomes": (outcome_figure(study.trials),),
        "questionnaire": (questionnaire_figure(study.trials),),
    }


def page(found: Findings, drawn: Mapping[str, tuple[PanelFigure, ...]]) -> str:
    """Write the page.

    Parameters
    ----------
    found : Findings
    drawn : mapping of str to tuple of PanelFigure
        As of `figures`.

    Returns
    -------
    str
        HTML.
    """
    from plotly.offline import get_plotlyjs

    study, settings = found.study, found.study.settings
    assets = files(__package__) / "assets"
    css = (files(report) / "assets" / "page.css").read_text(encoding="utf-8")
    css += (assets / "study.css").read_text(encoding="utf-8")
    environment = Environment(undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string((assets / "page.html.j2").read_text(encoding="utf-8"))
    animated = animation(study, found.path, found.still)
    median_heads, medians = tables.median_rows(found.medians, study.trials)
    test_heads, tests = tables.test_rows(found.tests, LEVEL)
    # A name in the settings may be anything; it must not end the script element that it lies in.
    text = json.dumps(animated, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return template.render(
        title="kinqp: guiding an arm into its joint limit, three ways",
        lead=_lead(settings),
        tiles=_tiles(found),
        verdicts=found.verdicts,
        verdict_note=_verdict_note(found.verdicts),
        colours=ALGORITHM_COLOURS,
        letters=list(study.runs),
        representative=settings.representative,
        animated=animated["runs"],
        charts={section: [_chart(one) for one in some] for section, some in drawn.items()},
        extremes=tables.extreme_rows(study),
        counts={
            "trials": study.trials.height,
            "tests": sum(one.test.p_value is not None for one in found.tests),
            "rough": any(one.test.p_value is not None and one.test.smallest_expected < 5.0 for one in found.tests),
        },
        median_heads=median_heads,
        medians=medians,
        test_heads=test_heads,
        tests=tests,
        yates=[two_decimals(one.corrected) for one in found.questionnaire.comparisons if one.printed is not None],
        thesis_tests=tables.thesis_rows(found.questionnaire),
        thesis_notes=tables.thesis_notes(found.questionnaire),
        limitations=limitations(study),
        facts=_facts(settings),
        characters=_characters(settings),
        settings=json.dumps(asdict(settings), indent=2),
        conditions=list(found.conditions.items()),
        footer=f"Written by kinqp from a study of {found.conditions.get('date', 'an unknown date')}, revision "
        f"{found.conditions.get('git', 'unknown')}.",
        css=Markup(css),  # noqa: S704  # ours
        plotly=Markup(get_plotlyjs()),  # noqa: S704  # a library's own source
        animation=Markup(text),  # noqa: S704  # escaped above
        scripts=[Markup((assets / name).read_text(encoding="utf-8")) for name in _SCRIPTS],  # noqa: S704  # ours
    )


def _chart(described: PanelFigure) -> dict[str, Any]:
    import plotly.io as pio

    html = pio.to_html(
        to_plotly(described),
        full_html=False,
        include_plotlyjs=False,
        div_id=f"plot-{described.key}",
        config={"displaylogo": False, "displayModeBar": False, "responsive": True},
    )
    return {
        "key": described.key,
        "title": described.title,
        "caption": described.caption,
        "html": Markup(html),  # noqa: S704  # plotly's own, of names and numbers of ours
    }


def _lead(settings: StudySettings) -> str:
    people = " and ".join(count(some, name) for name, some in settings.counts.items() if some)
    return (
        f"{count(settings.operators, 'simulated operator')} ({people}), {count(settings.trials, 'trial')} each with "
        f"every algorithm, in random order, on the {settings.robot}: the experiment of chapter 5 of A. Spinoglio's "
        f"thesis, again, measured at every tick of {1e3 * settings.dt:g} ms."
    )


def _tiles(found: Findings) -> list[dict[str, str]]:
    by = {one.outcome.key: one.by for one in found.medians}

    def tile(letter: str, key: str, label: str, unit: str, kind: str = "") -> dict[str, str]:
        value = number(by[key][letter, "all"].value)
        return {"value": value, "label": f"{letter}: {label} [{unit}], median", "kind": kind}

    judged = [one.holds for one in found.verdicts if one.holds is not None]
    holding = sum(judged)
    return [
        {
            "value": f"{holding} of {len(judged)}",
            "label": "expectations hold",
            "kind": "good" if holding == len(judged) else "bad",
        },
        *(tile(letter, "elbow_peak_qdd", "peak elbow acceleration", "rad/s²") for letter in found.study.runs),
        *(tile(letter, "time", "time to finish", "s") for letter in found.study.runs),
    ]


def _verdict_note(verdicts: Sequence[Verdict]) -> str:
    failing = [one.key for one in verdicts if one.holds is False]
    unknown = sum(one.holds is None for one in verdicts)
    told = "All of it holds." if not failing else f"{len(failing)} of {len(verdicts)} do not hold."
    return told + (f" {unknown} could not be judged." if unknown else "")


def _facts(settings: StudySettings) -> list[tuple[str, str]]:
    degrees = ", ".join(f"{57.29577951308232 * value:.1f}" for value in settings.q0)
    return [
        ("robot", settings.robot),
        ("mode", settings.mode),
        ("algorithms", ", ".join(f"{letter} = {name}" for letter, name in settings.algorithms.items())),
        ("start", f"{degrees} °"),
        ("path", f"semicircle, radius {settings.radius:g} m"),
        ("control period", f"{1e3 * settings.dt:g} ms"),
        ("seed", str(settings.seed)),
        ("operators", ", ".join(f"{some} {name}" for name, some in settings.counts.items())),
        ("trials", f"{settings.trials} for each operator and algorithm, ended after {settings.time_limit:g} s"),
        ("acceleration limits", ", ".join(f"{value:g}" for value in settings.qdd_max) + " rad/s²"),
    ]


def _characters(settings: StudySettings) -> dict[str, Any]:
    names = list(settings.characters)
    keys = list(dict.fromkeys(key for fields in settings.characters.values() for key in fields))
    rows = [
        {"name": key.replace("_", " "), "cells": [f"{settings.characters[name].get(key, NOTHING)}" for name in names]}
        for key in keys
    ]
    return {"names": names, "rows": rows}
