"""Files of a results folder that may be broken: cut off by a full disk or a copy, or edited by hand."""

from __future__ import annotations

import json
import zipfile
from typing import TYPE_CHECKING, Any, Final

import polars as pl

if TYPE_CHECKING:
    from pathlib import Path

_PARQUET: Final = b"PAR1"


class StoreError(RuntimeError):
    """A results folder can't be used as asked; the message says what to do."""


def read_object(path: Path, repair: str) -> dict[str, Any]:
    """Read a JSON file that holds an object.

    Parameters
    ----------
    path : Path
    repair : str
        What to do where the file is broken, for the message.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    StoreError
        When it is not that.
    """
    try:
        read = json.loads(path.read_text(encoding="utf-8"))
    # A file of nothing but brackets is nested deeper than Python goes.
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise broken(path, "JSON", str(error), repair) from error
    if not isinstance(read, dict):
        raise broken(path, "a JSON object", f"a {type(read).__name__}", repair)
    return read


def read_frame(path: Path, repair: str) -> pl.DataFrame:
    """Read a Parquet file; as `read_object`."""
    if not is_parquet(path):
        raise broken(path, "a whole Parquet file", f"{path.stat().st_size} bytes without its begin or end", repair)
    try:
        return pl.read_parquet(path)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise broken(path, "a whole Parquet file", " ".join(str(error).split())[:200], repair) from error


def is_parquet(path: Path) -> bool:
    """Whether a file begins and ends as a Parquet file does; one that was cut off does not.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    """
    with path.open("rb") as file:
        head = file.read(len(_PARQUET))
        size = file.seek(0, 2)
        file.seek(max(0, size - len(_PARQUET)))
        return size > 2 * len(_PARQUET) and head == file.read() == _PARQUET


def is_archive(path: Path) -> bool:
    """Whether there is a file of recorded problems, and it is whole."""
    return path.exists() and zipfile.is_zipfile(path)


def broken(path: Path, expected: str, got: str, repair: str) -> StoreError:
    """Make the error of a broken file: one sentence, and what to do."""
    return StoreError(f"{path}: expected {expected}, got {got}; {repair}")
