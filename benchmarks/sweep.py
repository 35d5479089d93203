"""The sweep: accuracy of all cells, in parallel; then their times, block by block, with nothing else running."""

from __future__ import annotations

import os
from contextlib import closing, suppress
from functools import partial
from typing import TYPE_CHECKING

from .cluster import on_a_cluster
from .conditions import conditions, timing_core
from .config import SweepConfig
from .loading import make_config
from .lock import sole_writer
from .messages import Begun, Ran
from .processes import Worker
from .schedule import Recorded, Task, on_this_machine
from .store import Part, Store, write_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from .cells import Block, Cell

    Progress = Callable[[int, int, str], None]


def sweep(
    config: SweepConfig | Mapping[str, object] | None = None,
    out: str | Path = "results",
    *,
    resume: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    on_progress: Progress | None = None,
) -> Store:
    """Run a sweep.

    First the accuracy part of every cell, its closed loop, in worker processes. Then the timing part, block by block,
    in one process on one core, with nothing else of the sweep running. A cell whose solver crashes, hangs or runs out
    of memory or disk has failed, and the store says why; the others go on. Each file is written whole or not at all
    as soon as there is something to write: interrupted in any way, the folder keeps all but the cells being run, or
    the last five seconds of timing. What could not be written is in the store's `unwritten`.

    Parameters
    ----------
    config : SweepConfig or mapping, optional
        What to run; the shipped default without it.
    out : str or Path
        Results folder.
    resume : bool
        Continue the sweep in `out`, where there is one. Cells that failed stay so.
    overwrite : bool
        Replace it.
    workers : int, optional
        Processes for the accuracy part; one for each core without it. The results are the same for any number.
    scheduler : str, optional
        Address of a Dask scheduler whose workers do the accuracy part instead, with the same results.
    on_progress : callable, optional
        Called with (parts done, parts in all, what is being done or was done last); every cell has two parts.

    Returns
    -------
    Store
        The results folder.

    Raises
    ------
    ConfigError
        Naming the key of `config` that is not usable.
    StoreError
        When `out` can't be used as asked, another sweep is running in it, or a file there is broken.
    ClusterError
        When the scheduler can't be used.
    """
    if workers is not None and workers < 1:
        raise ValueError(f"workers: expected at least 1, got {workers}")
    if not isinstance(config, SweepConfig):
        config = make_config(dict(config or {}))
    store = Store(out)
    with sole_writer(store.folder):
        store.begin(config, conditions(), resume=resume, overwrite=overwrite)
        return _Sweep(store, config, on_progress).run(workers or _cores(), scheduler)


class _Sweep:
    def __init__(self, store: Store, config: SweepConfig, on_progress: Progress | None) -> None:
        self._store = store
        self._config = config
        self._report = on_progress
        cells = store.manifest.cells
        self._outcomes = {cell: store.outcome(cell) for cell in cells}
        self._total = 2 * len(cells)
        self._done = sum(
            (outcome.accuracy is not None) + (outcome.timing is not None) for outcome in self._outcomes.values()
        )

    def run(self, workers: int, scheduler: str | None) -> Store:
        self._progress("")
        tasks = self._accuracy_tasks()
        if tasks:
            results = (
                on_a_cluster(tasks, self._config, scheduler)
                if scheduler
                else on_this_machine(tasks, self._config, workers)
            )
            self._take(results)
        self._time_all()
        return self._store

    def _accuracy_tasks(self) -> list[Task]:
        blocks: dict[Block, list[Cell]] = {}
        for cell in self._outcomes:
            blocks.setdefault(cell.block, []).append(cell)
        tasks: list[Task] = []
        for block, cells in blocks.items():
            untimed = any(self._outcomes[cell].timing is None for cell in cells)
            if untimed and not self._store.has_problems(block):
                tasks.append(Task(block))
            tasks += [Task(block, cell) for cell in cells if self._outcomes[cell].accuracy is None]
        return tasks

    def _take(self, results: Iterator[Ran | Recorded]) -> None:
        # Closed here and now, also when something is raised: its processes must be gone before anything is timed.
        with closing(results) as open_results:  # type: ignore[type-var]  # generators, of which only iteration is named
            for result in open_results:
                if isinstance(result, Recorded):
                    if isinstance(result.problems, bytes):
                        path = self._store.problems(result.block)
                        self._write(str(result.block), partial(write_whole, path, result.problems))
                    continue
                self._write(str(result.cell), partial(self._store.add_accuracy, result.cell, result.frame, result.part))
                self._done += 1
                self._progress(str(result.cell))

    def _time_all(self) -> None:
        blocks: dict[Block, list[Cell]] = {}
        for cell in self._outcomes:
            outcome = self._store.outcome(cell)
            if outcome.timing is not None:
                continue
            if outcome.accuracy is not None and outcome.accuracy.state == "done":
                blocks.setdefault(cell.block, []).append(cell)
            elif outcome.accuracy is not None:
                self._end(Ran(cell, None, Part("failed", "its accuracy part failed")))
        worker = Worker()
        try:
            for block, cells in blocks.items():
                path = self._store.problems(block)
                if not self._store.has_problems(block):
                    for cell in cells:
                        self._end(Ran(cell, None, Part("failed", "the block has no recorded problems")))
                    continue
                place = self._store.begun(block)
                begun = place.read_bytes() if place.exists() else None
                for answer in worker.time(path.read_bytes(), tuple(cells), self._config, timing_core(), begun):
                    if isinstance(answer, Ran):
                        self._end(answer)
                    elif isinstance(answer, Begun):
                        with suppress(OSError):  # without it more is lost if all is killed, and nothing else
                            write_whole(place, answer.content)
                    else:
                        self._progress(f"timing {answer.cell}")
                place.unlink(missing_ok=True)
        finally:
            worker.close()
            worker.stop()

    def _end(self, ran: Ran) -> None:
        self._write(f"times of {ran.cell}", partial(self._store.add_timing, ran.cell, ran.frame, ran.part))
        self._done += 1
        self._progress(f"timed {ran.cell}")

    def _write(self, what: str, write: Callable[[], None]) -> None:
        """Write something down; where that fails, as on a full disk, it is the end of this and not of all."""
        try:
            write()
        except OSError as error:
            self._store.unwritten[what] = str(error)

    def _progress(self, what: str) -> None:
        if self._report is not None:
            self._report(self._done, self._total, what)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
