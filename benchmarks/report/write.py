"""From a results folder to a page and figures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ..errors import ReportError
from ..metrics import records as records_of
from ..store import write_whole
from .page import page
from .paper import Selection, write_figures
from .profiles import profile
from .series import CLOCKS
from .source import cases_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from ..store import Store

_STARTS = ("cold", "active-set", "solution")


@dataclass(frozen=True)
class Report:
    """What was written.

    Attributes
    ----------
    page : Path
        The HTML page.
    figures : tuple of Path
        PNG and SVG files.
    cells : int
        Cells in the page.
    """

    page: Path
    figures: tuple[Path, ...] = field(default_factory=tuple)
    cells: int = 0


def write_report(
    store: Store,
    *,
    figures: bool = True,
    selection: Selection | None = None,
    on_progress: Callable[[str, int, int], None] | None = None,
) -> Report:
    """Write `report/index.html` into a results folder, and the paper's figures beside it.

    Parameters
    ----------
    store : Store
        The results folder, of a sweep that is complete or not.
    figures : bool
        False: the page alone.
    selection : Selection, optional
        Which scenarios, formulations and solvers the paper's figures show; see there for what they show without.
    on_progress : callable, optional
        Called with (what is being done, done, in all).

    Raises
    ------
    StoreError
        When the folder holds no sweep.
    ReportError
        When the sweep has not run a cell yet, or the selection names what it does not have.
    """
    note = on_progress or (lambda _what, _done, _total: None)
    manifest, cases = store.manifest, cases_of(store)
    if not any(case.outcome.accuracy for case in cases):
        raise ReportError(
            f"{store.folder}: expected a sweep with at least one cell run, got none; continue it with --resume"
        )
    chosen = selection or Selection()
    try:
        chosen.check(cases)
    except ValueError as error:
        raise ReportError(str(error)) from error
    note("measures", 0, 1)
    records = records_of(store)
    profiles = {}
    for clock in CLOCKS:
        for level in ("p50", "p99"):
            found = profile(records, f"{clock}_{level}", _STARTS)
            if found is not None:
                profiles[f"{clock}_{level}"] = found
    html = page(manifest, cases, records, profiles, on_progress=lambda done, total: note("page", done, total))
    folder = store.folder / "report"
    folder.mkdir(exist_ok=True)
    write_whole(folder / "index.html", html.encode())
    written: list[Path] = []
    if figures:
        written = write_figures(
            folder / "figures",
            cases,
            records,
            profiles,
            chosen,
            on_progress=lambda done, total: note("figures", done, total),
        )
    return Report(folder / "index.html", tuple(written), len(cases))
