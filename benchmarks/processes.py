"""Worker processes as their parent sees them: started, asked, given up when they die or take too long."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from multiprocessing.connection import Connection
from time import monotonic
from typing import TYPE_CHECKING, Any, Final

from .messages import Begun, Prepare, Ran, Refused, Run, Time, Visiting
from .store import Part

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .cells import Block, Cell
    from .config import SweepConfig

# Making a block ready is lowering and one run of the reference; no solver of a user's is in it.
_PREPARE_TIMEOUT: Final = 600.0
# A process that dies is not always the cell's fault: the machine may have wanted its memory. Once more, then it is.
ATTEMPTS: Final = 2
# A single-threaded process is what is measured, and what two of them beside each other don't fight over.
ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class WorkerDiedError(RuntimeError):
    """A worker process ended or was given up; the message says how."""


class Worker:
    """A worker process; started when first asked, and again after it died.

    Not to be shared between threads.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection[Any, Any] | None = None
        self._block: tuple[Block, SweepConfig] | None = None
        self._closed = False

    def problems(self, block: Block, config: SweepConfig) -> bytes | Refused:
        """Make a block ready and return its recorded problems; `Refused` says why it can't be."""
        answer: bytes | Refused = self._retried(
            lambda: self._ask(Prepare(block, config, problems=True), _PREPARE_TIMEOUT)
        )
        return answer

    def run(self, cell: Cell, config: SweepConfig) -> Ran:
        """Run the accuracy part of a cell; whatever happens to the process is this cell's end at worst."""
        answer = self._retried(lambda: self._run(cell, config))
        return Ran(cell, None, Part("failed", answer.reason)) if isinstance(answer, Refused) else answer

    def time(
        self,
        problems: bytes,
        cells: tuple[Cell, ...],
        config: SweepConfig,
        core: int | None,
        begun: bytes | None = None,
    ) -> Iterator[Visiting | Begun | Ran]:
        """Time a block's cells; where the process dies in a cell's visit that has failed, and the others go on.

        What is `begun` they go on from; a `Begun` is to be kept before the next answer is asked for.
        """
        deaths: dict[Cell, int] = {}
        while cells:
            visited: Cell | None = None
            kept: list[Ran] = []
            try:
                for answer in self._stream(Time(problems, cells, config, core, begun), config.cell_timeout):
                    if isinstance(answer, Visiting):
                        visited = answer.cell
                        yield answer
                        continue
                    if isinstance(answer, Begun):
                        begun = answer.content
                        yield answer
                        continue
                    kept.append(answer)
                    yield answer
            except WorkerDiedError as error:
                done = {ran.cell for ran in kept}
                cells = tuple(cell for cell in cells if cell not in done)
                culprit = visited if visited in cells else cells[0]
                deaths[culprit] = deaths.get(culprit, 0) + 1
                if deaths[culprit] >= ATTEMPTS or _is_timeout(error):
                    yield Ran(culprit, None, Part("failed", str(error)))
                    cells = tuple(cell for cell in cells if cell != culprit)
                continue
            return

    def close(self) -> None:
        """End the process for good; may be called from another thread than the one that is waiting for it."""
        self._closed = True
        process = self._process
        if process is not None:
            process.kill()

    def stop(self) -> None:
        """End the process, whatever it is doing."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        if self._connection is not None:
            self._connection.close()
        self._process = self._connection = self._block = None

    def _run(self, cell: Cell, config: SweepConfig) -> Any:
        if self._block != (cell.block, config):
            answer = self._ask(Prepare(cell.block, config, problems=False), _PREPARE_TIMEOUT)
            if isinstance(answer, Refused):
                return answer
            self._block = (cell.block, config)
        return self._ask(Run(cell), config.cell_timeout)

    def _retried(self, ask: Any) -> Any:
        for attempt in range(ATTEMPTS):
            try:
                return ask()
            except WorkerDiedError as error:
                if attempt == ATTEMPTS - 1 or _is_timeout(error):
                    return Refused(str(error))
        raise AssertionError("the loop returns")

    def _ask(self, request: object, timeout: float) -> Any:
        if isinstance(request, Prepare):
            self._block = None
        return next(self._stream(request, timeout))

    def _stream(self, request: object, timeout: float) -> Iterator[Any]:
        """Send a request and give the answers up to the last, each within `timeout` [s]."""
        try:
            connection = self._started()
            connection.send(request)
            while True:
                until = monotonic() + timeout
                if not connection.poll(max(until - monotonic(), 0.0)):
                    self.stop()
                    raise WorkerDiedError(f"{_TIMED_OUT} {timeout:g} s and was stopped")
                answer = connection.recv()
                if isinstance(request, Time):
                    if answer is None:
                        return
                    if isinstance(answer, Refused):
                        raise WorkerDiedError(answer.reason)
                yield answer
                if not isinstance(request, Time):
                    return
                if isinstance(answer, Begun):
                    connection.send("kept")
        except (EOFError, OSError) as error:
            raise WorkerDiedError(self._how_it_ended()) from error

    def _started(self) -> Connection[Any, Any]:
        if self._connection is not None and self._process is not None and self._process.poll() is None:
            return self._connection
        self.stop()
        if self._closed:
            raise WorkerDiedError("the sweep was ended")
        ours, theirs = socket.socketpair()
        # -P: the folder that the module happens to be run from must not come first among those to import from.
        command = [sys.executable, "-P", "-m", "kinqp.benchmarks.worker", str(theirs.fileno())]
        self._process = subprocess.Popen(
            command, pass_fds=(theirs.fileno(),), env=os.environ | ONE_THREAD, stdin=subprocess.DEVNULL,
            # Ctrl-C is the parent's to handle.
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        theirs.close()
        self._connection = Connection(ours.detach())
        self._connection.send(list(sys.path))
        # What a process takes to start, on a busy machine, is no cell's time.
        if not self._connection.poll(_PREPARE_TIMEOUT):
            self.stop()
            raise WorkerDiedError(f"the process did not start within {_PREPARE_TIMEOUT:g} s")
        self._connection.recv()
        return self._connection

    def _how_it_ended(self) -> str:
        if self._process is None:
            return "the process was stopped"
        self._process.wait()
        code = self._process.returncode
        self.stop()
        if code >= 0:
            return f"the process ended with exit code {code}"
        name = signal.Signals(-code).name
        return f"the process was ended by {name}" + (", as when memory runs out" if name == "SIGKILL" else "")


_TIMED_OUT: Final = "the process took longer than"


def _is_timeout(error: WorkerDiedError) -> bool:
    return str(error).startswith(_TIMED_OUT)
