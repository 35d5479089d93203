"""One writer in a results folder at a time."""

from __future__ import annotations

import fcntl
import json
import os
import socket
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from .reading import StoreError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_NAME = "running.lock"


@contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Hold a folder's lock, made if need be; the folder, too.

    The lock is the system's own on a file in the folder, so that it ends with the process, however that ends: there is
    nothing to clean up after a crash. What the file says is who holds it.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    StoreError
        When another process holds it, here or on another host; the message names it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / _NAME
    with path.open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StoreError(_held(folder, _read(path), "wait for it or end it, or give another folder")) from None
        before = _read(path)
        # Its own host would have let go of a dead process's lock. Of another host this one may not know, as on network
        # file systems without locks.
        if before.get("host", socket.gethostname()) != socket.gethostname():
            raise StoreError(_held(folder, before, f"if that has ended, delete {path}"))
        file.truncate(0)
        since = datetime.now(UTC).isoformat(timespec="seconds")
        file.write(json.dumps({"pid": os.getpid(), "host": socket.gethostname(), "since": since}) + "\n")
        file.flush()
        try:
            yield
        finally:
            with suppress(OSError):
                file.truncate(0)


def _read(path: Path) -> dict[str, Any]:
    """Who holds the lock, as far as the file says so."""
    with suppress(OSError, ValueError, RecursionError):
        read = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(read, dict):
            return read
    return {}


def _held(folder: Path, by: dict[str, Any], remedy: str) -> str:
    pid, host, since = (by.get(name, f"unknown {name}") for name in ("pid", "host", "since"))
    return (
        f"{folder}: expected no other process to write here, got process {pid} on {host}, running since {since}; "
        f"{remedy}"
    )
