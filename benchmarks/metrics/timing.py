"""What a cell's replayed ticks cost: three columns, never mixed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from .intervals import Estimate, clusters, percentiles
from .ticks import FrameError

if TYPE_CHECKING:
    import polars as pl
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Integers = NDArray[np.int64]

LEVELS: Final = (50.0, 95.0, 99.0, 99.9, 100.0)
# Control periods whose deadlines are counted [s].
DEADLINES: Final = (1e-3, 0.25e-3)
_NONE: Final = Estimate(None, None, None)


@dataclass(frozen=True)
class TimeSpread:
    """One column of times.

    Attributes
    ----------
    samples, repeats : int
        How many values, from how many repeats; 0 where the column holds none, and the rest is None.
    mean : float
        [s].
    p50, p95, p99, p999, max : Estimate
        Values that occurred, with bootstrap intervals [s]; see `percentiles` for what those of the last two are worth.
    late_1khz, late_4khz : float
        Shares of samples above 1 ms and above 0.25 ms.
    """

    samples: int
    repeats: int
    mean: float | None = None
    p50: Estimate = _NONE
    p95: Estimate = _NONE
    p99: Estimate = _NONE
    p999: Estimate = _NONE
    max: Estimate = _NONE
    late_1khz: float | None = None
    late_4khz: float | None = None

    @classmethod
    def of(cls, values: Array, tick: Integers, repeat: Integers, *, seed: int = 0) -> TimeSpread:
        """Sum up times [s], shape (N,), NaN where there is none, measured at `tick` in `repeat`, shapes (N,)."""
        there = np.isfinite(values)
        values, tick, repeat = values[there], tick[there], repeat[there]
        if not values.size:
            return cls(0, 0)
        estimates = percentiles(values, clusters(tick, repeat), LEVELS, seed=seed)
        p50, p95, p99, p999, largest = estimates
        fast, faster = (float(np.mean(values > deadline)) for deadline in DEADLINES)
        repeats, mean = len(np.unique(repeat)), float(values.mean())
        return cls(len(values), repeats, mean, p50, p95, p99, p999, largest, fast, faster)


@dataclass(frozen=True)
class CellTimes:
    """All times of a cell.

    Attributes
    ----------
    wall : TimeSpread
        Update and solve together, through Python; of ticks that followed another, whose set-up was kept.
    update, solve : TimeSpread
        The same apart.
    setup : TimeSpread
        Full set-ups, without the solve, through Python.
    own : TimeSpread
        By the solver's own timer.
    c : TimeSpread
        Measured in C.
    """

    wall: TimeSpread
    update: TimeSpread
    solve: TimeSpread
    setup: TimeSpread
    own: TimeSpread
    c: TimeSpread

    @classmethod
    def of(cls, times: pl.DataFrame | None, *, seed: int = 0) -> CellTimes:
        """Sum up a cell's `times` frame; without one, or without rows, nothing was measured.

        Raises
        ------
        FrameError
            When a column is missing.
        """
        if times is None or not len(times):
            return cls(*[TimeSpread(0, 0)] * 6)
        for name in ("tick", "repeat", "wall_setup", "wall_update", "wall_solve", "own", "c"):
            if name not in times.columns:
                raise FrameError(f"times: expected a column {name!r}, got {', '.join(times.columns)}")
        tick, repeat = (times[name].to_numpy().astype(np.int64) for name in ("tick", "repeat"))
        setup, update, solve, own, c = (
            np.array(times[name].to_list(), dtype=float)
            for name in ("wall_setup", "wall_update", "wall_solve", "own", "c")
        )
        solve = np.where(np.isfinite(update), solve, np.nan)
        columns = (update + solve, update, solve, setup, own, c)
        return cls(*(TimeSpread.of(column, tick, repeat, seed=seed) for column in columns))
