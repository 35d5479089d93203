"""What is kept of a block's times before all of its cells are done, so that a continuation need not begin again."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass

import polars as pl

from .problems import Window

_NAME = "cell"


@dataclass(frozen=True)
class Progress:
    """How far a cell has come.

    Attributes
    ----------
    windows : tuple of Window
        What of the recording it has time for: the same in all its visits.
    frame : pl.DataFrame
        Times of the visits so far.
    repeats : int
        How many these are.
    digest : str
        Of the first visit's answers; empty where there was none.
    deterministic : bool
        Whether all others gave the same.
    """

    windows: tuple[Window, ...]
    frame: pl.DataFrame
    repeats: int
    digest: str
    deterministic: bool


def to_bytes(progress: dict[str, Progress]) -> bytes:
    """Write the progress of a block's cells, by their files' stems: a line of JSON, and a Parquet file of all times."""
    head = {
        name: {
            "windows": [[window.lead, *window.ticks] for window in one.windows],
            "repeats": one.repeats,
            "digest": one.digest,
            "deterministic": one.deterministic,
        }
        for name, one in progress.items()
    }
    frames = [one.frame.with_columns(pl.lit(name).alias(_NAME)) for name, one in progress.items() if one.repeats]
    buffer = io.BytesIO()
    (pl.concat(frames) if frames else pl.DataFrame()).write_parquet(buffer, compression="zstd")
    return json.dumps(head).encode() + b"\n" + buffer.getvalue()


def from_bytes(content: bytes) -> dict[str, Progress]:
    """Read what `to_bytes` wrote; nothing where that was broken since: its cells are timed from the first visit."""
    try:
        return _read(content)
    except (ValueError, KeyError, TypeError, RecursionError, pl.exceptions.PolarsError, pl.exceptions.PanicException):
        return {}


def _read(content: bytes) -> dict[str, Progress]:
    head, _, times = content.partition(b"\n")
    frame = pl.read_parquet(io.BytesIO(times))
    found = {}
    for name, one in json.loads(head).items():
        windows = tuple(Window(lead, tuple(ticks)) for lead, *ticks in one["windows"])
        own = frame.filter(pl.col(_NAME) == name).drop(_NAME) if one["repeats"] else pl.DataFrame()
        found[name] = Progress(windows, own, one["repeats"], one["digest"], one["deterministic"])
    return found
