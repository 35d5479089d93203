"""The accuracy parts on a Dask cluster: each of its workers keeps a worker process of ours, as this machine would."""

from __future__ import annotations

import atexit
import socket
import sys
import threading
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from time import sleep
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import urlsplit

from .messages import Ran, Refused
from .processes import Worker
from .schedule import Recorded, Task, do

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from .config import SweepConfig

# How long to wait for the scheduler, and for its first worker [s].
_PATIENCE: Final = 30.0
# How often to look for results [s].
_POLL: Final = 0.02
_LOCAL: Final = threading.local()


class ClusterError(RuntimeError):
    """A Dask cluster can't be used; the message says what to do."""


def on_a_cluster(tasks: Sequence[Task], config: SweepConfig, scheduler: str) -> Iterator[Ran | Recorded]:
    """Do tasks on a cluster; gives what they come to as it comes.

    A worker that is lost costs what it was doing: Dask gives that to another one. Tasks of a block prefer one worker,
    which has it ready.

    Parameters
    ----------
    tasks : sequence of Task
    config : SweepConfig
    scheduler : str
        Address, as in "tcp://host:8786".

    Raises
    ------
    ClusterError
        When distributed is not installed, there is no scheduler or no worker there, or the scheduler is lost.
    """
    if find_spec("distributed") is None:
        raise ClusterError("--scheduler: expected Dask to be installed, got nothing: pip install 'kinqp[cluster]'")
    _check_reachable(scheduler)
    distributed: Any = import_module("distributed")  # which is not typed throughout

    try:
        client: Any = distributed.Client(scheduler, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"--scheduler: expected a Dask scheduler at {scheduler}, got: {error}") from error
    with client, client.as_current():
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError as error:
            raise ClusterError(f"--scheduler: expected workers at {scheduler}, none came in {_PATIENCE:g} s") from error
        addresses = sorted(client.scheduler_info(n_workers=-1)["workers"])
        order = {block: index for index, block in enumerate(dict.fromkeys(task.block for task in tasks))}
        futures = {
            client.submit(
                _do_there, task, config, list(sys.path), pure=False, allow_other_workers=True,
                workers=[addresses[order[task.block] % len(addresses)]], retries=0,
            ): task
            for task in tasks
        }  # fmt: skip
        waiting = distributed.as_completed(futures)
        try:
            while futures:
                # Not `next`, which waits for ever once the scheduler is gone.
                while not waiting.has_ready():
                    if client.status != "running":
                        raise ConnectionError(f"the connection is {client.status}")
                    sleep(_POLL)
                future = next(waiting)
                yield _result(future, futures.pop(future))
        except (distributed.CancelledError, distributed.TimeoutError, OSError) as error:
            # With its scheduler a client loses all that it has asked for.
            why = " ".join(str(error).split())  # Dask's words may go over several lines
            raise ClusterError(
                f"--scheduler: expected the Dask scheduler at {scheduler} until all is done, and it is gone ({why}); "
                "what came back is kept: start one and continue with --resume"
            ) from error
        finally:
            with suppress(Exception):  # a scheduler that is gone has nothing to cancel
                client.cancel(list(futures))


def _check_reachable(scheduler: str) -> None:
    """Find out in plain words, before Dask tries for long and complains in its own."""
    try:
        parts = urlsplit(scheduler)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise ClusterError(f"--scheduler: expected an address such as tcp://host:8786, got {scheduler!r}")
    try:
        socket.create_connection((host, port), timeout=_PATIENCE).close()
    except OSError as error:
        raise ClusterError(f"--scheduler: expected a Dask scheduler at {scheduler}, got: {error}") from error


def _result(future: Any, task: Task) -> Ran | Recorded:
    error = future.exception(timeout=_PATIENCE)
    if error is None:
        found: Ran | Recorded = future.result()
        return found
    if not isinstance(error, import_module("distributed").KilledWorker):
        raise error
    # Our own processes shield the workers from solvers: that one after the other was lost is the cluster's doing.
    reason = f"the cluster lost one worker after the other with it: {error}"
    if task.cell is None:
        return Recorded(task.block, Refused(reason))
    from .store import Part

    return Ran(task.cell, None, Part("failed", reason))


def _do_there(task: Task, config: SweepConfig, path: list[str]) -> Ran | Recorded:
    """On a cluster's worker: do a task in the process that belongs to this thread."""
    # Where the client finds its modules, as far as the file system is shared; behind what the worker has itself.
    sys.path += [folder for folder in path if folder not in sys.path]
    worker: Worker | None = getattr(_LOCAL, "worker", None)
    if worker is None:
        worker = _LOCAL.worker = Worker()
        atexit.register(worker.close)
    return do(task, worker, config)
