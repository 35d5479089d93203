"""What the sweep's table says of a cell: iterations, times, errors, limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from .metrics import Motion, Ticks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .scenarios import Scenario

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """A distribution.

    Attributes
    ----------
    samples : int
        How many values it is made of.
    mean, std, p50, p95, p99, max : float
        Percentiles are values that occurred (the next one up), not interpolations.
    """

    samples: int
    mean: float
    std: float
    p50: float
    p95: float
    p99: float
    max: float

    @classmethod
    def of(cls, values: Array) -> Spread:
        """Sum up values of any shape; at least one."""
        p50, p95, p99 = (float(x) for x in np.percentile(values, [50, 95, 99], method="inverted_cdf"))
        return cls(values.size, float(values.mean()), float(values.std()), p50, p95, p99, float(values.max()))


@dataclass(frozen=True)
class CellSummary:
    """One row of the table.

    Attributes
    ----------
    ticks : int
        Size of the run.
    iterations : Spread or None
        Over ticks; None where the solver tells none.
    time : Spread or None
        Update plus solve through Python [s], over timed ticks and repeats; None where there are no times.
    setup, own, c : float
        Medians of a full set-up through Python, of the solve by the solver's own timer, and in C [s]; NaN: none.
    fixed_error : float
        Largest error of a locked row [m/s, rad/s].
    bound_violation : float
        Largest excess over a joint velocity bound [rad/s or m/s].
    peak_acceleration : float
        Largest joint acceleration, as a share of the joint's limit in this run, over all joints; NaN without a closed
        loop.
    watched_acceleration : float
        The same of the joints that the scenario is about; NaN where there is none, or no closed loop.
    failed : float
        Share of ticks that ended in the safe stop.
    on_limit : float
        Share of ticks with a watched joint within `metrics.ON_LIMIT` of a limit of this run; NaN as above.
    task_error : float
        Mean norm of the Cartesian error [m/s, rad/s].
    """

    ticks: int
    iterations: Spread | None
    time: Spread | None
    setup: float
    own: float
    c: float
    fixed_error: float
    bound_violation: float
    peak_acceleration: float
    watched_acceleration: float
    failed: float
    on_limit: float
    task_error: float


def cell_summary(ticks: pl.DataFrame, times: pl.DataFrame | None, scenario: Scenario) -> CellSummary:
    """Sum up a cell.

    Parameters
    ----------
    ticks, times : pl.DataFrame
        As `Store.ticks` and `Store.times` give them.
    scenario : Scenario
        What was run.

    Raises
    ------
    FrameError
        When the ticks are none of this scenario's.
    """
    # The report's own figures: what both show of a cell is computed once.
    motion = Motion.of(Ticks(scenario, ticks))
    length = ticks["eps"].list.eval(pl.element() ** 2).list.sum().sqrt()
    return CellSummary(
        ticks=len(ticks),
        iterations=None if ticks["iterations"].has_nulls() else Spread.of(ticks["iterations"].to_numpy().astype(float)),
        time=None if times is None else Spread.of((times["wall_update"] + times["wall_solve"]).drop_nulls().to_numpy()),
        setup=_median(times, "wall_setup"),
        own=_median(times, "own"),
        c=_median(times, "c"),
        fixed_error=float(ticks["fixed_error"].to_numpy().max()),
        bound_violation=float(ticks["bound_violation"].to_numpy().max()),
        peak_acceleration=_or_nan(motion.peak_acceleration),
        watched_acceleration=_or_nan(motion.watched_acceleration),
        failed=float(np.mean(ticks["status"].to_numpy() != scenario.expects.value)),
        on_limit=_or_nan(motion.on_limit),
        task_error=float(length.to_numpy().mean()),
    )


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else value


def _median(times: pl.DataFrame | None, column: str) -> float:
    values = None if times is None else times[column].drop_nulls()
    return float("nan") if values is None or not len(values) else float(np.median(values.to_numpy()))
