"""From a study to its page, figures and summary."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..report.paper.style import save, style
from ..store import write_whole
from .findings import Findings, analyse
from .page import figures, page
from .panels_paper import to_paper
from .stills import arm_figure

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from .result import StudyResult


@dataclass(frozen=True)
class Written:
    """What was written.

    Attributes
    ----------
    page : Path
    figures : tuple of Path
        PNG and SVG files.
    findings : Findings
        What they show.
    """

    page: Path
    figures: tuple[Path, ...]
    findings: Findings


def write_study(
    study: StudyResult,
    folder: Path,
    conditions: Mapping[str, str],
    *,
    on_stage: Callable[[str], None] | None = None,
) -> Written:
    """Write `index.html`, `summary.json` and `figures/` of a study to a folder; what is there of these is replaced.

    Parameters
    ----------
    study : StudyResult
        With algorithms A, B and C.
    folder : Path
        Made if need be.
    conditions : mapping of str to str
        Under which it was run.
    on_stage : callable, optional
        Told what is being done.
    """
    tell = on_stage or (lambda _: None)
    tell("statistics")
    found = analyse(study, conditions)
    drawn = figures(found)
    tell("page")
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / "index.html", page(found, drawn).encode())
    write_whole(folder / "summary.json", (json.dumps(found.summary(), indent=1, allow_nan=False) + "\n").encode())
    tell("figures")
    written: list[Path] = []
    with style():
        for described in (one for some in drawn.values() for one in some):
            written += save(to_paper(described), folder / "figures" / described.key)
        written += save(arm_figure(found), folder / "figures" / "arm")
    return Written(folder / "index.html", tuple(written), found)
