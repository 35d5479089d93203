"""Who runs which cell next: the accuracy parts, on this machine's workers or on a cluster's."""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .processes import Worker

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from .cells import Block, Cell
    from .config import SweepConfig
    from .messages import Ran, Refused


@dataclass(frozen=True)
class Task:
    """A piece of work: a cell's accuracy part, or a block's problems to be recorded."""

    block: Block
    cell: Cell | None = None


@dataclass(frozen=True)
class Recorded:
    """A block's problems, or why there are none."""

    block: Block
    problems: bytes | Refused


def do(task: Task, worker: Worker, config: SweepConfig) -> Ran | Recorded:
    """Do a task in a worker process."""
    if task.cell is None:
        return Recorded(task.block, worker.problems(task.block, config))
    return worker.run(task.cell, config)


def on_this_machine(tasks: Sequence[Task], config: SweepConfig, workers: int) -> Iterator[Ran | Recorded]:
    """Do tasks in a number of worker processes; gives what they come to as it comes.

    A worker stays with a block as long as there is something to do in it, because making it ready takes time.
    """
    pending = _Pending(tasks)
    results: queue.Queue[Ran | Recorded | BaseException] = queue.Queue()
    processes = [Worker() for _ in range(workers)]

    def work(worker: Worker) -> None:
        task: Task | None = None
        try:
            while (task := pending.next(task)) is not None:
                results.put(do(task, worker, config))
        except BaseException as error:  # noqa: BLE001  # a mistake of ours, to be raised where it is seen
            results.put(error)

    threads = [threading.Thread(target=work, args=(worker,), daemon=True) for worker in processes]
    for thread in threads:
        thread.start()
    try:
        for _ in tasks:
            result = results.get()
            if isinstance(result, BaseException):
                raise result
            yield result
    finally:
        pending.clear()
        for worker in processes:
            worker.close()
        for thread in threads:
            thread.join(timeout=10.0)
        for worker in processes:
            worker.stop()


class _Pending:
    """Tasks to do, handed out block by block."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._lock = threading.Lock()
        self._blocks: dict[Block, list[Task]] = {}
        for task in tasks:
            self._blocks.setdefault(task.block, []).append(task)
        self._owned: dict[Block, int] = {}

    def next(self, last: Task | None) -> Task | None:
        """Give the next task to who did `last`; None: there is nothing left."""
        with self._lock:
            if last is not None:
                if self._blocks.get(last.block):
                    return self._take(last.block)
                self._owned[last.block] -= 1
            # A block that nobody is at; else the one with most left to do for each who is.
            left = [block for block, tasks in self._blocks.items() if tasks]
            if not left:
                return None
            block = min(left, key=self._rank)
            self._owned[block] = self._owned.get(block, 0) + 1
            return self._take(block)

    def _rank(self, block: Block) -> tuple[bool, float]:
        owners = self._owned.get(block, 0)
        return owners > 0, -len(self._blocks[block]) / owners if owners else 0.0

    def clear(self) -> None:
        """Leave the rest undone."""
        with self._lock:
            self._blocks.clear()

    def _take(self, block: Block) -> Task:
        return self._blocks[block].pop(0)
