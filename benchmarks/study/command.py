"""All of `kinqp study`: run the trials, then write the page, with the conditions under which they were run."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Final

from ..conditions import conditions
from ..reading import read_object
from ..store import write_whole
from .trials import run_study
from .write import write_study

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from .result import StudySettings
    from .write import Written

_CONDITIONS: Final = "conditions.json"


def run_and_write(
    settings: StudySettings,
    folder: Path,
    *,
    processes: int = 2,
    resume: bool = False,
    overwrite: bool = False,
    on_trial: Callable[[int, int], None] | None = None,
    on_stage: Callable[[str], None] | None = None,
) -> Written:
    """Run a study and write its page.

    Parameters
    ----------
    settings, folder, processes, resume, overwrite, on_trial
        As of `run_study`. A study that is complete already, resumed, is only written again; conditions are those of the
        run that completed it.
    on_stage : callable, optional
        Told what is being done once the trials are.

    Raises
    ------
    StudyError
        As `run_study`.
    """
    now, path = conditions(), folder / _CONDITIONS
    if overwrite:
        path.unlink(missing_ok=True)
    study = run_study(settings, folder, processes=processes, resume=resume, overwrite=overwrite, on_trial=on_trial)
    if not path.exists():
        write_whole(path, (json.dumps(now, indent=1) + "\n").encode())
    known: dict[str, str] = read_object(path, "delete it, and the study is told to be of today")
    return write_study(study, folder, known, on_stage=on_stage)
