"""All figures of a report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..palette import styles
from ..scorecard import scorecard_rows
from ..series import CLOCKS
from .distributions import distributions_figure, profile_figure
from .limits import phase_figure, singular_figure
from .over_time import iterations_figure, times_figure
from .scorecard import scorecard_figure
from .style import Series, save, style

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    import polars as pl
    from matplotlib.figure import Figure

    from ..profiles import Profile
    from ..scorecard import Row
    from ..source import Case
    from .selection import Selection


def write_figures(
    folder: Path,
    cases: Sequence[Case],
    records: pl.DataFrame,
    profiles: Mapping[str, Profile],
    selection: Selection,
    *,
    on_progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Write the figures of each selected scenario, the performance profile and the scorecard, as PNG and SVG.

    Parameters
    ----------
    folder : Path
        Made if it isn't there. What it holds of an earlier report is overwritten, not removed.
    cases : sequence of Case
    records : pl.DataFrame
        One row per cell that was run.
    profiles : mapping of str to Profile
    selection : Selection
    on_progress : callable, optional
        Called with (scenarios done, in all).
    """
    chosen = selection.of(cases)
    solvers = list(dict.fromkeys(case.cell.solver for case in cases if not case.cell.is_baseline))
    formulations = list(dict.fromkeys(case.cell.formulation for case in cases))
    looks = styles(solvers), styles(formulations)
    written: list[Path] = []
    with style():
        for number, name in enumerate(chosen.scenarios):
            some = [case for case in cases if case.cell.scenario == name]
            for kind, made in _of_scenario(some, chosen, *looks):
                written += save(made, folder / f"{_plain(name)}-{kind}")
            if on_progress is not None:
                on_progress(number + 1, len(chosen.scenarios))
        overall = {clock: profiles[f"{clock}_p50"] for clock in CLOCKS if f"{clock}_p50" in profiles}
        for kind, figure in (
            ("performance-profile", profile_figure(overall, looks[0])),
            ("scorecard", scorecard_figure(_scored(scorecard_rows(records), chosen))),
        ):
            written += [] if figure is None else save(figure, folder / kind)
    return written


def _of_scenario(
    cases: Sequence[Case],
    chosen: Selection,
    solver_looks: Mapping[str, tuple[str, str]],
    formulation_looks: Mapping[str, tuple[str, str]],
) -> list[tuple[str, Figure]]:
    by_solver = [
        Series(
            case,
            case.ticks(),
            case.times(),
            *(formulation_looks[case.cell.formulation] if case.cell.is_baseline else solver_looks[case.cell.solver]),
        )
        for case in cases
        if case.cell.formulation in chosen.formulations
        and (case.cell.is_baseline or (case.cell.solver in chosen.solvers and case.cell.start == chosen.start))
    ]
    # At limits and singularities it is formulations that differ: solvers of one all answer the same.
    by_formulation = [
        Series(one.case, one.ticks, one.times, *formulation_looks[one.case.cell.formulation])
        for one in by_solver
        if one.case.cell.is_baseline or one.case.cell.solver == chosen.solvers[0]
    ]
    if not by_solver:
        return []
    scenario = by_solver[0].case.scenario
    made = {"iterations": iterations_figure(by_solver, scenario), "cdf": distributions_figure(by_solver)}
    for clock in CLOCKS:
        made[f"time-{clock}"] = times_figure(by_solver, scenario, clock, cut=False)
        made[f"time-{clock}-p95"] = times_figure(by_solver, scenario, clock, cut=True)
    made["singularities"] = singular_figure(by_formulation, scenario)
    made["joint-limits"] = phase_figure(by_formulation, scenario)
    return [(kind, figure) for kind, figure in made.items() if figure is not None]


def _scored(rows: Sequence[Row], chosen: Selection) -> list[Row]:
    return [row for row in rows if row.is_baseline or (row.solver == chosen.solvers[0] and row.start == chosen.start)]


def _plain(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)
