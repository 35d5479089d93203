"""What a sweep leaves behind: a folder with a manifest and, for each cell, its ticks, its times and how it ended."""

from __future__ import annotations

import io
import json
import os
import tempfile
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from .config import SweepConfig, cells_of, skipped_of
from .manifest import FORMAT, Manifest, read_manifest, tuples
from .reading import StoreError, broken, is_archive, is_parquet, read_frame, read_object

if TYPE_CHECKING:
    import polars as pl

    from .cells import Block, Cell

_FOLDERS: Final = ("ticks", "times", "cells", "problems", "records")
# Between a sweep and its continuation these may differ.
_MAY_CHANGE: Final = frozenset({"date"})
_AGAIN: Final = "delete it and continue the sweep with --resume, which runs that cell again"


@dataclass(frozen=True)
class Part:
    """How a part of a cell ended.

    Attributes
    ----------
    state : {"done", "failed"}
    reason : str
        Why it failed; empty where it did not.
    loop : {"closed", "states", "sampled", "replay"}
        Accuracy: the solver's own closed loop, the scenario's states, or some of the reference's. Timing: "replay".
    ticks, repeats : int
        Sample sizes.
    deterministic : bool
        Timing: whether every repeat gave the same answers, bit for bit.
    notes : tuple of str
        What else a reader must know, such as why a column is empty.
    """

    state: Literal["done", "failed"]
    reason: str = ""
    loop: str = ""
    ticks: int = 0
    repeats: int = 0
    deterministic: bool = True
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """How a cell ended; a part that is None has not been run."""

    accuracy: Part | None = None
    timing: Part | None = None

    @property
    def failed(self) -> str:
        """Why the cell failed; empty where it did not."""
        return next((part.reason for part in (self.accuracy, self.timing) if part and part.state == "failed"), "")


class Store:
    """A results folder.

    Parameters
    ----------
    folder : Path
        Made when a sweep is begun in it.

    Attributes
    ----------
    unwritten : dict of str to str
        What the last sweep could not write, and why; a continuation tries again.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder: Final = Path(folder)
        self.unwritten: Final[dict[str, str]] = {}

    def begin(self, config: SweepConfig, conditions: dict[str, str], *, resume: bool, overwrite: bool) -> None:
        """Prepare the folder for a sweep.

        Raises
        ------
        StoreError
            When it holds a sweep and neither `resume` nor `overwrite` is asked for, or `resume` is and the sweep there
            has another configuration or was measured elsewhere, or one of its files is broken.
        """
        if resume and overwrite:
            raise StoreError(f"{self.folder}: expected either --resume or --overwrite, got both")
        if self._path.exists() and not overwrite:
            self._check_resumable(config, conditions, resume=resume)
        else:
            # The manifest goes first and comes last: a folder with one has nothing of another sweep in it.
            self._path.unlink(missing_ok=True)
            for name in _FOLDERS:
                (self.folder / name).mkdir(parents=True, exist_ok=True)
                for old in (self.folder / name).iterdir():
                    old.unlink()
            content = {
                "format": FORMAT,
                "config": config.model_dump(mode="json"),
                "conditions": conditions,
                "cells": [asdict(cell) for cell in cells_of(config)],
                "skipped": skipped_of(config),
            }
            write_whole(self._path, (json.dumps(content, indent=1) + "\n").encode())
        for name in _FOLDERS:
            (self.folder / name).mkdir(exist_ok=True)
            for partial in (self.folder / name).glob("*.partial"):
                partial.unlink()
        self.__dict__.pop("manifest", None)

    def _check_resumable(self, config: SweepConfig, conditions: dict[str, str], *, resume: bool) -> None:
        if not resume:
            raise StoreError(
                f"{self.folder} holds a sweep already: give --resume to continue it, --overwrite to replace it, "
                "or another folder with --out"
            )
        if self.manifest.config.model_dump(mode="json") != config.model_dump(mode="json"):
            raise StoreError(f"{self.folder} holds a sweep with another configuration: expected the same to resume it")
        for key, value in self.manifest.conditions.items():
            if key not in _MAY_CHANGE and conditions.get(key) != value:
                raise StoreError(
                    f"{self.folder} was measured with {key} {value!r} and this is {conditions.get(key)!r}: "
                    "times of the two don't belong into one table; give another folder with --out"
                )
        # Now rather than after hours, when the table is made.
        for cell in self.manifest.cells:
            self.outcome(cell)
            for path in (self._file("ticks", cell), self._file("times", cell)):
                if path.exists() and not is_parquet(path):
                    read_frame(path, _AGAIN)

    @cached_property
    def manifest(self) -> Manifest:
        """What was asked for, and how it was measured.

        Raises
        ------
        StoreError
            When there is none, or it can't be read.
        """
        try:
            return read_manifest(self._path)
        except OSError as error:
            raise StoreError(f"{self.folder}: expected a sweep's manifest.json there: {error}") from error

    def cells(self) -> tuple[Cell, ...]:
        """Cells whose ticks are there, in the manifest's order."""
        return tuple(cell for cell in self.manifest.cells if self._file("ticks", cell).exists())

    def failed(self) -> dict[Cell, str]:
        """Cells that failed, in either part, and why."""
        reasons = {cell: self.outcome(cell).failed for cell in self.manifest.cells}
        return {cell: reason for cell, reason in reasons.items() if reason}

    def outcome(self, cell: Cell) -> Outcome:
        """How a cell ended, as far as it has been run; a part whose ticks or times are gone has not been.

        Raises
        ------
        StoreError
            When the file that says so is broken.
        """
        path = self.folder / "cells" / f"{cell.file_stem}.json"
        try:
            read = read_object(path, _AGAIN)
            parts = {name: _part(part) for name, part in read.items()}
            outcome = Outcome(**parts)
        except FileNotFoundError:
            return Outcome()
        except (TypeError, ValueError, AttributeError) as error:
            raise broken(path, "the end of a cell", str(error), _AGAIN) from error
        return Outcome(
            *(
                None if part and part.state == "done" and not self._file(folder, cell).exists() else part
                for folder, part in (("ticks", outcome.accuracy), ("times", outcome.timing))
            )
        )

    def ticks(self, cell: Cell) -> pl.DataFrame:
        """Ticks of a cell's accuracy part, one per row; the columns are those of `kinqp.benchmarks.accuracy`."""
        return read_frame(self._file("ticks", cell), _AGAIN)

    def times(self, cell: Cell) -> pl.DataFrame | None:
        """Times of a cell, one tick of one repeat per row, as `kinqp.benchmarks.replay` has them; None: not timed."""
        path = self._file("times", cell)
        return read_frame(path, _AGAIN) if path.exists() else None

    def content(self, cell: Cell) -> bytes:
        """Bytes of a cell's files: the same frames where they are the same."""
        parts = [path.read_bytes() for path in (self._file("ticks", cell), self._file("times", cell)) if path.exists()]
        return b"".join(len(part).to_bytes(8, "big") + part for part in parts)

    def record(self, cell: Cell) -> Path:
        """Where a cell's record is kept."""
        return self.folder / "records" / f"{cell.file_stem}.json"

    def add_accuracy(self, cell: Cell, ticks: bytes | None, part: Part) -> None:
        """Keep the accuracy part of a cell: its ticks as a Parquet file, none where it failed."""
        if ticks is not None:
            write_whole(self._file("ticks", cell), ticks)
        self._end(cell, Outcome(part, self.outcome(cell).timing))

    def add_timing(self, cell: Cell, times: bytes | None, part: Part) -> None:
        """Keep the timing part of a cell."""
        if times is not None:
            write_whole(self._file("times", cell), times)
        self._end(cell, Outcome(self.outcome(cell).accuracy, part))

    def _end(self, cell: Cell, outcome: Outcome) -> None:
        content = json.dumps(asdict(outcome), indent=1) + "\n"
        write_whole(self.folder / "cells" / f"{cell.file_stem}.json", content.encode())

    def problems(self, block: Block) -> Path:
        """Where a block's recorded problems are kept."""
        return self.folder / "problems" / f"{block.file_stem}.npz"

    def has_problems(self, block: Block) -> bool:
        """Whether a block's problems are recorded; what was cut off is none, and is recorded again."""
        return is_archive(self.problems(block))

    def begun(self, block: Block) -> Path:
        """Where what a block's timing has come to is kept until it is done."""
        return self.folder / "problems" / f"{block.file_stem}.begun"

    @property
    def _path(self) -> Path:
        return self.folder / "manifest.json"

    def _file(self, folder: str, cell: Cell) -> Path:
        return self.folder / folder / f"{cell.file_stem}.parquet"


def parquet(frame: pl.DataFrame) -> bytes:
    """Return a frame as a Parquet file."""
    buffer = io.BytesIO()
    frame.write_parquet(buffer, compression="zstd")
    return buffer.getvalue()


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all, whatever happens meanwhile: beside its place, to the disk, into its place."""
    handle, name = tempfile.mkstemp(prefix=path.name[:100], suffix=".partial", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _part(read: dict[str, Any] | None) -> Part | None:
    part = None if read is None else Part(**tuples(read))
    if part is not None and part.state not in ("done", "failed"):
        raise ValueError(f"expected the state done or failed, got {part.state!r}")
    return part
