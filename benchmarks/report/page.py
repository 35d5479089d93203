"""The report as one HTML page that needs nothing else: data, curves, plotly and scripts are inside."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from ..cells import STARTS
from ..metrics import REQUIREMENTS
from .columns import COLUMNS
from .envelope import envelope
from .notes import limitations, settings
from .palette import styles
from .profiles import competitor
from .scorecard import scorecard_rows
from .series import CLOCKS
from .traces import curves, packed, rounded
from .verdict import verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import polars as pl

    from ..manifest import Manifest
    from ..scenarios import Scenario
    from .profiles import Profile
    from .source import Case

_SCRIPTS: Final = ("state.js", "figures.js", "table.js", "overview.js", "page.js")
_START_NAMES: Final = {"cold": "cold", "active-set": "last active set", "solution": "last solution"}
_EXAMPLE: Final = "joint-space wall_p99<200"
# Of all curves together [bytes], as they lie in the page; what a cell costs there, and each of its buckets, as measured
# on closed loops with two clocks.
_BUDGET: Final = 13_000_000
_PER_CELL: Final = 4_000
_PER_BUCKET: Final = 27
_MOST_BUCKETS: Final = 300
_FEWEST_BUCKETS: Final = 60


def buckets_for(cells: int) -> int:
    """How finely the curves of so many cells can be drawn in a page that still opens at once."""
    return max(_FEWEST_BUCKETS, min(_MOST_BUCKETS, (_BUDGET // max(cells, 1) - _PER_CELL) // _PER_BUCKET))


def page(
    manifest: Manifest,
    cases: Sequence[Case],
    records: pl.DataFrame,
    profiles: Mapping[str, Profile],
    *,
    on_progress: Callable[[int, int], None] | None = None,
) -> str:
    """Write the page.

    Parameters
    ----------
    manifest : Manifest
    cases : sequence of Case
        At least one.
    records : pl.DataFrame
        One row per cell that was run.
    profiles : mapping of str to Profile
        By clock and percentile, as "wall_p50".
    on_progress : callable, optional
        Called with (cells done, cells in all).

    Returns
    -------
    str
        HTML.
    """
    flat = {
        (row["scenario"], row["formulation"], row["solver"], row["start"]): row for row in records.iter_rows(named=True)
    }
    keys = list(dict.fromkeys(column.key for column in COLUMNS if column.key in records.columns))
    buckets = buckets_for(len(cases))
    cells: list[dict[str, Any]] = []
    packed_curves: list[tuple[int, str]] = []
    for number, case in enumerate(cases):
        cell = case.cell
        record, ticks = flat.get((cell.scenario, cell.formulation, cell.solver, cell.start)), case.ticks()
        state, reason = verdict(case, record, ticks)
        cells.append(
            {
                "id": number, "scenario": cell.scenario, "formulation": cell.formulation, "solver": cell.solver,
                "start": cell.start, "state": state, "reason": reason,
                "values": None if record is None else [_value(record[key]) for key in keys],
            }
        )  # fmt: skip
        packed_curves.append((number, packed(curves(ticks, case.times(), case.scenario, buckets))))
        if on_progress is not None:
            on_progress(number + 1, len(cases))
    data = _data(cases, cells, keys, profiles)
    return _render(manifest, cases, cells, data, packed_curves, records, buckets)


def _data(
    cases: Sequence[Case], cells: list[dict[str, Any]], keys: list[str], profiles: Mapping[str, Profile]
) -> dict[str, Any]:
    formulations = list(dict.fromkeys(case.cell.formulation for case in cases))
    solvers = list(dict.fromkeys(case.cell.solver for case in cases if not case.cell.is_baseline))
    present = {case.cell.start for case in cases}
    scenarios = {case.cell.scenario: case.scenario for case in cases}
    return {
        "scenarios": [_scenario(name, scenario) for name, scenario in scenarios.items()],
        "formulations": formulations,
        "baselines": list(dict.fromkeys(case.cell.formulation for case in cases if case.cell.is_baseline)),
        "solvers": solvers,
        "starts": [start for start in STARTS if start in present],
        "start_names": _START_NAMES,
        "clocks": [{"name": name, "text": text} for name, text in CLOCKS.items()],
        "styles": {"solvers": styles(solvers), "formulations": styles(formulations)},
        "columns": [asdict(column) | {"at": keys.index(column.key)} for column in COLUMNS if column.key in keys],
        "first_measure": "wall_p50" if "wall_p50" in keys else (keys or [""])[0],
        "cells": cells,
        "profiles": {name: _profile(one) for name, one in profiles.items()},
        "baseline": competitor(solvers[0], "cold") if solvers else "",
    }


def _scenario(name: str, scenario: Scenario) -> dict[str, Any]:
    switches, at = [], 0.0
    for phase in scenario.phases[:-1]:
        at += round(phase.duration / scenario.dt) * scenario.dt
        switches.append(round(at, 6))
    unit = "states" if scenario.states is not None else f"ticks of {1e3 * scenario.dt:g} ms"
    areas = [envelope(scenario, joint) for joint in scenario.watched_joints]
    return {
        "name": name,
        "description": scenario.description,
        "facts": f"{scenario.robot.name}; {', then '.join(map(str, scenario.modes))}; {scenario.ticks} {unit}; "
        f"right answer: {scenario.expects.value.replace('_', ' ')}",
        "dt": scenario.dt,
        "independent": scenario.states is not None,
        "switches": switches,
        "watched": [{"index": joint, "name": scenario.robot.joint_names[joint]} for joint in scenario.watched_joints],
        "envelopes": [
            {
                "joint": area.joint,
                "q": rounded(area.q, 6),
                **{k: [rounded(b) for b in v] for k, v in area.bounds.items()},
            }
            for area in areas
            if area is not None
        ],
    }


def _profile(one: Profile) -> dict[str, Any]:
    return {
        "curves": [
            {"name": c.name, "solver": c.solver, "start": c.start, "ratio": rounded(c.ratio), "share": rounded(c.share)}
            for c in one.curves
        ],
        "means": [asdict(mean) for mean in one.means],
        "baseline": one.baseline,
        "problems": one.problems,
    }


def _value(value: object) -> object:
    """A value for JSON: six digits of a number, None for what is not one."""
    return rounded([value], 6)[0] if isinstance(value, float) else value


def _render(
    manifest: Manifest,
    cases: Sequence[Case],
    cells: list[dict[str, Any]],
    data: dict[str, Any],
    packed_curves: list[tuple[int, str]],
    records: pl.DataFrame,
    buckets: int,
) -> str:
    assets = files(__package__) / "assets"
    environment = Environment(undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string((assets / "page.html.j2").read_text(encoding="utf-8"))
    # A name in a configuration may be anything; it must not end the script element that it lies in.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    baselines = len(data["baselines"])
    names = [len(data["formulations"]) - baselines, len(data["solvers"]), len(data["scenarios"])]
    what = f"{names[0]} formulations \u00d7 {names[1]} solvers"
    what += (
        f", and {baselines} baselines, \u00d7 {names[2]} scenarios" if baselines else f" \u00d7 {names[2]} scenarios"
    )
    count = {
        state: sum(cell["state"] == state for cell in cells)
        for state in ("failed", "dishonest", "unsolved", "not run", "ok")
    }
    rows = scorecard_rows(records)
    conditions = manifest.conditions
    failed = [
        {"name": str(case.cell), "state": cell["state"], "reason": cell["reason"]}
        for case, cell in zip(cases, cells, strict=True)
        if cell["state"] != "ok"
    ]
    return template.render(
        title=f"kinqp: {what}",
        heading="Resolving a hand-guided arm's motion, measured",
        lead=f"{what} in {len(cells):,} cells, measured on "
        f"{conditions.get('cpu', 'an unknown CPU')}, {conditions.get('date', 'at an unknown date')}.",
        tiles=_tiles(len(cells), count, rows),
        score=rows,
        requirements=REQUIREMENTS,
        start_names=_START_NAMES,
        thinning=f"Drawn are the smallest and largest value of each of up to {buckets} stretches of the run.",
        filter_example=_EXAMPLE,
        failed=failed,
        limitations=limitations(manifest, cases, buckets),
        conditions=list(conditions.items()),
        settings=settings(manifest),
        footer=f"Written by kinqp from a sweep of {conditions.get('date', 'unknown date')}, "
        f"revision {conditions.get('git', 'unknown')}.",
        css=Markup((assets / "page.css").read_text(encoding="utf-8")),  # noqa: S704  # ours
        data=Markup(text),  # noqa: S704  # escaped above
        curves=packed_curves,
        plotly=Markup(get_plotlyjs()),  # noqa: S704  # a library's own source
        scripts=[Markup((assets / name).read_text(encoding="utf-8")) for name in _SCRIPTS],  # noqa: S704  # ours
    )


def _tiles(total: int, count: dict[str, int], rows: Sequence[object]) -> list[dict[str, object]]:
    def tile(value: int, label: str, help_: str, kind: str = "") -> dict[str, object]:
        return {"value": f"{value:,}", "label": label, "help": help_, "kind": kind}

    def bad(state: str) -> str:
        return "bad" if count[state] else "good"

    return [
        tile(total, "cells", "Scenario x formulation x solver x start, and scenario x baseline."),
        tile(
            count["ok"],
            "right at every tick",
            "By residuals that we compute, or a certificate where one is expected.",
            "good",
        ),
        tile(
            count["unsolved"], "unsolved at times, and said so", "Some ticks, or all, ended without the right answer."
        ),
        tile(
            count["dishonest"],
            "dishonest",
            "Claimed to have solved what they had not, or the reverse.",
            bad("dishonest"),
        ),
        tile(count["failed"], "failed", "Could not be run: crashed, too slow, or not applicable.", bad("failed")),
        tile(len(rows), "controllers scored", "Formulation x solver x start, and baselines."),
        *([tile(count["not run"], "not run yet", "The sweep has not come to them.")] if count["not run"] else []),
    ]
