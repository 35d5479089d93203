"""What runs solvers: a process of its own, so that one that crashes, hangs or eats all memory takes no sweep along.

``python -m kinqp.benchmarks.worker FD`` speaks with its parent through the connection FD; see `Worker`.
"""

from __future__ import annotations

import contextlib
import os
import sys
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, Final

from .messages import Begun, Prepare, Ran, Refused, Run, Time, Visiting

if TYPE_CHECKING:
    from collections.abc import Callable

    from .accuracy import PreparedBlock
    from .baseline_block import BaselineBlock
    from .cells import Block, Cell
    from .config import SweepConfig

    _Key = tuple[Block, SweepConfig]

# How much timing may be lost when all is killed [s]; keeping it takes some milliseconds, in which nothing is timed.
_KEEP_EVERY: Final = 5.0
# Prepared blocks that a worker keeps: on a cluster neighbouring cells come in any order.
_KEPT: Final = 3


def serve(connection: Connection) -> None:
    """Answer requests until the parent is gone."""
    blocks: dict[_Key, PreparedBlock | BaselineBlock] = {}
    last: _Key | None = None
    while True:
        try:
            request = connection.recv()
        except EOFError:
            return
        answer: object
        try:
            if isinstance(request, Prepare):
                answer = _prepare(request, blocks)
                last = (request.block, request.config)
            elif isinstance(request, Run):
                answer = _run(request.cell, blocks[last]) if last else Refused("no block is ready")
            else:
                _time(request, connection)
                answer = None
        except Exception as error:  # noqa: BLE001  # it ends this request, and the parent says so
            answer = Refused(f"{type(error).__name__}: {error}")
        connection.send(answer)


def _prepare(request: Prepare, blocks: dict[_Key, PreparedBlock | BaselineBlock]) -> bytes | None:
    from .accuracy import PreparedBlock
    from .baseline_block import BaselineBlock

    key = (request.block, request.config)
    if key not in blocks:
        while len(blocks) >= _KEPT:
            blocks.pop(next(iter(blocks)))
        kind = BaselineBlock if request.block.baseline else PreparedBlock
        blocks[key] = kind(request.block, request.config)
    return blocks[key].problems.to_bytes() if request.problems else None


def _run(cell: Cell, block: PreparedBlock | BaselineBlock) -> Ran:
    from .store import parquet

    frame, part = block.run(cell)
    return Ran(cell, parquet(frame), part)


def _time(request: Time, connection: Connection) -> None:
    from .begun import Progress, from_bytes, to_bytes
    from .problems import Problems
    from .replay import time_block
    from .scenarios import get_scenario
    from .situations import Situations
    from .store import Part, parquet

    if request.core is not None:
        os.sched_setaffinity(0, {request.core})
    first, problems = request.cells[0], request.problems
    last = monotonic()

    def on_progress(progress: Callable[[], dict[str, Progress]]) -> None:
        nonlocal last
        if monotonic() - last > _KEEP_EVERY:
            connection.send(Begun(to_bytes(progress())))
            connection.recv()
            last = monotonic()

    for cell, frame, part in time_block(
        Situations.from_bytes(problems, get_scenario(first.scenario))
        if first.is_baseline
        else Problems.from_bytes(problems),
        request.cells,
        request.config,
        lambda cell, repeat: connection.send(Visiting(cell, repeat)),
        lambda cell, reason: connection.send(Ran(cell, None, Part("failed", reason))),
        begun=from_bytes(request.begun) if request.begun is not None else None,
        on_progress=on_progress,
    ):
        connection.send(Ran(cell, parquet(frame), part))


def main() -> None:
    """Serve the connection whose file descriptor is the first argument."""
    connection: Connection[Any, Any] = Connection(int(sys.argv[1]))
    sys.path[:] = connection.recv()
    # Not when they are first asked for, which is in a cell's time.
    for module in ("accuracy", "replay"):
        import_module(f"{__spec__.parent}.{module}")
    connection.send("ready")
    # Where memory runs out, the kernel is to take this process, and not the one that keeps the results.
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    serve(connection)


if __name__ == "__main__":
    main()
