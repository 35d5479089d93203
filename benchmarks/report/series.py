"""What a figure draws of a cell's two frames; statistics are the metrics' business."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from ..metrics import Ticks

if TYPE_CHECKING:
    import polars as pl
    from numpy.typing import NDArray

    from ..scenarios import Scenario

    Array = NDArray[np.float64]
    Index = NDArray[np.int64]

# The three ways a solve is timed, and what each of them measures. They are never drawn on one axis: a solver's own
# timer leaves out what the call from Python costs, and C has no such call.
CLOCKS: Final = {
    "wall": "update + solve through Python",
    "own": "the solver's own timer",
    "c": "in C, without Python",
}

# Where figure 4.8 of the thesis cuts.
CUT: Final = 0.95


@dataclass(frozen=True)
class Samples:
    """Timed solves.

    Attributes
    ----------
    tick : ndarray of int, shape (N,)
        Which QP of the trajectory, ascending; as many entries of a tick as it has repeats.
    seconds : ndarray, shape (N,)
        [s].
    """

    tick: Index
    seconds: Array

    def cut(self, share: float = CUT) -> Samples:
        """Leave out what is slower than the given percentile of all samples (thesis, figure 4.8)."""
        if not self.seconds.size:
            return self
        keep = self.seconds <= np.percentile(self.seconds, 100.0 * share, method="inverted_cdf")
        return Samples(self.tick[keep], self.seconds[keep])


def samples(times: pl.DataFrame, clock: str) -> Samples:
    """Solves of a cell by one clock; none where the solver doesn't have that clock.

    The ticks that a replay sets a solver up at are left out: they are not what a control cycle pays.

    Parameters
    ----------
    times : pl.DataFrame
        A cell's `times` frame.
    clock : str
        A key of `CLOCKS`.
    """
    if clock not in CLOCKS:
        raise ValueError(f"clock: expected one of {', '.join(CLOCKS)}, got {clock!r}")
    update = _floats(times, "wall_update")
    seconds = update + _floats(times, "wall_solve") if clock == "wall" else _floats(times, clock)
    tick = times["tick"].to_numpy().astype(np.int64)
    there = np.isfinite(seconds) & np.isfinite(update)
    tick, seconds = tick[there], seconds[there]
    order = np.argsort(tick, kind="stable")
    return Samples(tick[order], seconds[order])


def acceleration_share(ticks: pl.DataFrame, scenario: Scenario) -> Array | None:
    """Largest joint acceleration of each tick as a share of its limit, shape (N,); None where it is no closed loop."""
    cell = Ticks(scenario, ticks)
    return np.max(np.abs(cell.acceleration), axis=1) if cell.closed_loop else None


def positions(ticks: pl.DataFrame, scenario: Scenario) -> Index:
    """Which tick of the scenario each row is, from 0: a solver too slow for a run of its own has only some."""
    return np.rint(ticks["t"].to_numpy() / scenario.dt).astype(np.int64)


def vectors(frame: pl.DataFrame, name: str) -> Array:
    """A column of vectors of equal length as an array, shape (N, length)."""
    values = frame[name]
    stacked: Array = np.array(values.to_list(), dtype=np.float64)
    return stacked.reshape(len(values), -1)


def _floats(frame: pl.DataFrame, name: str) -> Array:
    """A column of numbers with NaN where there is none."""
    values: Array = frame[name].cast(float, strict=True).to_numpy().astype(np.float64)
    return values
