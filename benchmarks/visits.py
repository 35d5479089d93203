"""What all visits of a timed cell have in common: how much of the recording they have time for, and what they keep."""

from __future__ import annotations

import hashlib
from time import perf_counter
from typing import TYPE_CHECKING, Final

import polars as pl

from .begun import Progress
from .problems import Window
from .store import Part

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Rows = dict[str, list[float | int | None]]

# How often a few ticks are tried to see how long they take.
_TRIALS: Final = 3
_COLUMNS: Final = ("tick", "repeat", "wall_setup", "wall_update", "wall_solve", "own", "c")


def no_rows() -> Rows:
    """Columns to be filled tick by tick: `tick`, and [s] `wall_setup`, `wall_update`, `wall_solve`, `own`."""
    return {name: [] for name in ("tick", "wall_setup", "wall_update", "wall_solve", "own")}


def affordable(windows: Sequence[Window], budget: float, visit: Callable[[Window], None]) -> tuple[Window, ...]:
    """Give the windows, from the first, that one visit has time for: at least one tick.

    Parameters
    ----------
    windows : sequence of Window
    budget : float
        Of one visit [s].
    visit : callable
        Does all ticks of a window once.
    """
    first = windows[0]
    short = Window(first.lead, first.ticks[:3])
    taken: list[float] = []
    # The best of a few, since others on the machine make it longer; of one, where that alone is too long.
    while len(taken) < _TRIALS and sum(taken) < budget:
        start = perf_counter()
        visit(short)
        taken.append(perf_counter() - start)
    each = min(taken) / (1 + len(short.ticks))
    found: list[Window] = []
    for window in windows:
        ticks = window.ticks[: max(int(budget / each) - 1, 0)]
        budget -= each * (1 + len(ticks))
        if not ticks:
            break
        found.append(Window(window.lead, ticks))
    return tuple(found) or (Window(first.lead, first.ticks[:1]),)


class Visits:
    """Times of a cell, visit by visit, and whether all visits gave the same answers, bit for bit.

    Parameters
    ----------
    begun : Progress, optional
        Visits of an earlier process, that count as this one's.
    """

    def __init__(self, begun: Progress | None = None) -> None:
        self._frames: Final[list[pl.DataFrame]] = [begun.frame] if begun and begun.repeats else []
        self.repeats = begun.repeats if begun else 0
        self._digest = begun.digest if begun else ""
        self._deterministic = begun.deterministic if begun else True

    def add(self, repeat: int, rows: Rows, answers: list[Array], c: Sequence[float] | None = None) -> None:
        """Keep a visit: its times, its answers, and times in C where there are any [s]."""
        frame = pl.DataFrame(rows, schema={"tick": pl.Int64} | dict.fromkeys(list(rows)[1:], pl.Float64))
        self._frames.append(
            frame.with_columns(
                pl.lit(repeat, dtype=pl.Int64).alias("repeat"),
                pl.Series("c", [None] * len(frame) if c is None else c, dtype=pl.Float64),
            ).select(_COLUMNS)
        )
        self.repeats += 1
        digest = hashlib.blake2b(b"".join(answer.tobytes() for answer in answers), digest_size=16).hexdigest()
        self._digest = self._digest or digest
        self._deterministic &= digest == self._digest

    def result(self, ticks: int, notes: Sequence[str]) -> tuple[pl.DataFrame, Part]:
        """Give all times, one tick of one repeat per row, and how the cell ended; `ticks` were timed in each repeat."""
        part = Part("done", "", "replay", ticks, self.repeats, self._deterministic, tuple(notes))
        return self.frame(), part

    def frame(self) -> pl.DataFrame:
        """All times so far; at least one visit's."""
        return pl.concat(self._frames)

    def progress(self, windows: tuple[Window, ...]) -> Progress:
        """How far the cell has come, for another process to go on from."""
        frame = self.frame() if self.repeats else pl.DataFrame()
        return Progress(windows, frame, self.repeats, self._digest, self._deterministic)
