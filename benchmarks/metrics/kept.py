"""Records kept beside the results they are of, so that a second report of thousands of cells has them at once."""

from __future__ import annotations

import contextlib
import hashlib
import json
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from ..scenarios import get_scenario, is_builtin
from ..store import write_whole
from .record import cell_record

if TYPE_CHECKING:
    from ..cells import Cell
    from ..store import Store

# Beside the library's own files, what a record follows from.
_PACKAGES: Final = ("numpy", "polars", "pin", "casadi")


def record_of(store: Store, cell: Cell) -> dict[str, Any]:
    """Give the flat record of a cell: the one kept, where it is of these frames and of this library, or a new one.

    Only of the library's own scenarios records are kept: what another one is made of, its file does not say.

    Parameters
    ----------
    store : Store
        The results folder.
    cell : Cell
        One that has been run.
    """
    place = store.record(cell)
    key = _key(store.content(cell)) if is_builtin(cell.scenario) else None
    if key is not None:
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            kept = json.loads(place.read_text(encoding="utf-8"))
            if kept["key"] == key:
                found: dict[str, Any] = kept["record"]
                return found
    made = cell_record(
        store.ticks(cell), store.times(cell), get_scenario(cell.scenario),
        formulation=cell.formulation, solver=cell.solver, start=cell.start,
    ).flat() | {"scenario": cell.scenario}  # fmt: skip
    if key is not None:
        # A folder that can't be written to, or is full, can be read all the same.
        with contextlib.suppress(OSError):
            place.parent.mkdir(exist_ok=True)
            write_whole(place, json.dumps({"key": key, "record": made}).encode())
    return made


def _key(content: bytes) -> str:
    digest = hashlib.blake2b(content, digest_size=16)
    digest.update(_library())
    return digest.hexdigest()


@cache
def _library() -> bytes:
    """Digest of all files of this library, and of the versions of what computes with it."""
    digest = hashlib.blake2b(digest_size=16)
    root = Path(__file__).parents[2]
    for path in sorted(root.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    for package in _PACKAGES:
        digest.update(f"{package} {version(package)}\0".encode())
    return digest.digest()
