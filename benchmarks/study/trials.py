"""Run a study: all trials in worker processes, one file each, to be interrupted and resumed."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, Final

import polars as pl

from ..lock import sole_writer
from ..processes import ONE_THREAD
from ..reading import read_object
from ..store import write_whole
from .outcomes import joint_torques
from .plan import Course, Trial, trials_of
from .result import TRIAL_COLUMNS, StudyError, StudyResult, StudySettings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path


def run_study(
    settings: StudySettings,
    folder: Path,
    *,
    processes: int = 2,
    resume: bool = False,
    overwrite: bool = False,
    on_trial: Callable[[int, int], None] | None = None,
) -> StudyResult:
    """Run all trials of a study, write what they come to, and return it.

    Every trial's row is a file of its own in `folder/trials`, written whole or not at all: an interrupted study loses
    the trials that were running, and `resume` goes on with the rest. The same settings give the same result, however
    many processes there are and wherever it was interrupted.

    Parameters
    ----------
    settings : StudySettings
        As from `study_settings`.
    folder : Path
        Made if need be. It will hold `plan.json`, `trials/*.json`, and what `StudyResult.write` writes.
    processes : int
        How many workers.
    resume, overwrite : bool
        What to do where the folder holds a study already: go on with it, or begin anew.
    on_trial : callable, optional
        Called with (trials done, trials in all), at the beginning and after every trial.

    Raises
    ------
    StudyError
        When the folder holds a study and neither is asked for, or one with other settings is to be resumed; when a
        worker fails.
    """
    if processes < 1:
        raise StudyError(f"processes: expected at least one, got {processes}")
    with sole_writer(folder):
        _begin(settings, folder, resume=resume, overwrite=overwrite)
        return _run(settings, folder, processes, on_trial)


def _run(
    settings: StudySettings, folder: Path, processes: int, on_trial: Callable[[int, int], None] | None
) -> StudyResult:
    trials = trials_of(settings)
    left = [trial for trial in trials if not _path(folder, trial).exists()]
    tell = on_trial or (lambda _done, _all: None)
    tell(len(trials) - len(left), len(trials))
    _run_all(left, folder, processes, lambda count: tell(len(trials) - len(left) + count, len(trials)))
    result = _result(settings, folder, trials)
    result.write(folder)
    return result


def _begin(settings: StudySettings, folder: Path, *, resume: bool, overwrite: bool) -> None:
    """Prepare the folder: the plan in it is written last, so that it holds nothing of another study."""
    if resume and overwrite:
        raise StudyError(f"{folder}: expected either resume or overwrite, got both")
    plan, asked = folder / "plan.json", json.loads(json.dumps(asdict(settings)))
    if plan.exists() and not overwrite:
        if not resume:
            raise StudyError(
                f"{folder} holds a study already: give --resume to continue it, --overwrite to replace it, "
                "or another folder with --out"
            )
        if read_object(plan, "take it from a copy, or begin the study anew with --overwrite") != asked:
            raise StudyError(f"{folder} holds a study with other settings: expected the same to resume it")
    else:
        plan.unlink(missing_ok=True)
        (folder / "trials").mkdir(parents=True, exist_ok=True)
        for old in (folder / "trials").iterdir():
            old.unlink()
        write_whole(plan, (json.dumps(asked, indent=1) + "\n").encode())
    for partial in (folder / "trials").glob("*.partial"):
        partial.unlink()


def _run_all(left: Sequence[Trial], folder: Path, processes: int, tell: Callable[[int], None]) -> None:
    """Run trials in workers, each of which takes the next one when it is done with its last."""
    pending: queue.SimpleQueue[Trial] = queue.SimpleQueue()
    for trial in left:
        pending.put(trial)
    done: queue.Queue[Trial | BaseException] = queue.Queue()
    workers = [_Worker(folder) for _ in range(min(processes, len(left)))]

    def work(worker: _Worker) -> None:
        try:
            while True:
                trial = pending.get_nowait()
                worker.run(trial)
                done.put(trial)
        except queue.Empty:
            return
        except BaseException as error:  # noqa: BLE001  # raised where it is seen, in the thread that asked
            done.put(error)

    try:
        for worker in workers:
            threading.Thread(target=work, args=(worker,), daemon=True).start()
        for count in range(1, len(left) + 1):
            ended = done.get()
            if isinstance(ended, BaseException):
                raise ended
            tell(count)
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A process that runs trials, one at a time."""

    def __init__(self, folder: Path) -> None:
        # -P: the folder that the module happens to be run from must not come first among those to import from.
        # Ctrl-C is the parent's to handle: hence a session of its own.
        self._process: Final = subprocess.Popen(
            [sys.executable, "-P", "-m", "kinqp.benchmarks.study.worker", str(folder)],
            env=os.environ | ONE_THREAD, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, start_new_session=True,
        )  # fmt: skip

    def run(self, trial: Trial) -> None:
        """Run a trial; its row is in its file then.

        Raises
        ------
        StudyError
            When the process has ended, with what it said last.
        """
        process = self._process
        assert process.stdin is not None, "a pipe"  # noqa: S101  # for mypy, like the next two
        assert process.stdout is not None, "a pipe"  # noqa: S101
        assert process.stderr is not None, "a pipe"  # noqa: S101
        try:
            process.stdin.write(trial.name + "\n")
            process.stdin.flush()
            answer = process.stdout.readline().strip()
        except OSError:
            answer = ""
        if answer != trial.name:
            process.kill()
            said = process.stderr.read().strip().splitlines()[-1:]
            raise StudyError(f"trial {trial.name}: its process ended: {''.join(said) or 'it said nothing'}")

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()


def _result(settings: StudySettings, folder: Path, trials: Sequence[Trial]) -> StudyResult:
    rows: list[dict[str, Any]] = [read_object(_path(folder, trial), _AGAIN) for trial in trials]
    frame = pl.DataFrame(rows, schema=TRIAL_COLUMNS).sort("algorithm", "operator", "trial")
    chosen = representative(frame)
    course = Course.of(settings)
    runs = {letter: course.run(Trial(letter, *chosen))[0] for letter in settings.algorithms}
    torques = {letter: joint_torques(run) for letter, run in runs.items()}
    return StudyResult(frame, runs, torques, replace(settings, representative=chosen))


def representative(trials: pl.DataFrame) -> tuple[int, int]:
    """Operator and trial nearest to what is usual: whose times rank closest to the median with every algorithm.

    The thesis shows "the most common pattern" (5.3) and does not say how it was found. Here every trial's time is
    ranked among those with the same algorithm, and the (operator, trial) whose ranks are the least far from the middle
    one, summed over the algorithms, is taken; the first of several.
    """
    middle = (pl.len() + 1) / 2
    off = trials.with_columns(((pl.col("time").rank("average") - middle).abs()).over("algorithm").alias("off"))
    best = off.group_by("operator", "trial").agg(pl.col("off").sum()).sort("off", "operator", "trial").row(0)
    return int(best[0]), int(best[1])


_AGAIN = "delete it and continue the study with --resume, which runs that trial again"


def _path(folder: Path, trial: Trial) -> Path:
    return folder / "trials" / f"{trial.name}.json"
