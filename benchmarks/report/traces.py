"""A cell's curves for the page: thinned, rounded, compressed."""

from __future__ import annotations

import base64
import gzip
import json
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from .downsample import distribution, extremes
from .envelope import unit_of
from .series import CLOCKS, acceleration_share, positions, samples, vectors

if TYPE_CHECKING:
    import polars as pl
    from numpy.typing import ArrayLike, NDArray

    from ..scenarios import Scenario

    Array = NDArray[np.float64]
    Index = NDArray[np.int64]

# Digits that survive; a screen shows three.
_DIGITS: Final = 4


def curves(ticks: pl.DataFrame | None, times: pl.DataFrame | None, scenario: Scenario, buckets: int) -> dict[str, Any]:
    """Gather what the page draws of one cell.

    Parameters
    ----------
    ticks, times : pl.DataFrame or None
        The cell's frames; a part that was not run is left out.
    scenario : Scenario
    buckets : int
        How many buckets of neighbouring ticks a curve is thinned to; each gives its smallest and its largest value.

    Returns
    -------
    dict
        For `json`: curves as ``{"i": ticks, "y": values}``, None where a value is not finite.
    """
    drawn: dict[str, Any] = {}
    if ticks is not None and len(ticks):
        tick = positions(ticks, scenario)
        if not ticks["iterations"].has_nulls():
            drawn["iterations"] = _curve(tick, ticks["iterations"].to_numpy(), buckets)
        drawn["sigma"] = _curve(tick, ticks["sigma_min"].to_numpy(), buckets)
        drawn["scale"] = _curve(tick, ticks["task_scale"].to_numpy(), buckets)
        acceleration = acceleration_share(ticks, scenario)
        if acceleration is not None:
            drawn["acceleration"] = _curve(tick, acceleration, buckets)
            drawn["phase"] = {str(joint): _phase(ticks, scenario, joint, buckets) for joint in scenario.watched_joints}
    if times is not None and len(times):
        for clock in CLOCKS:
            all_of = samples(times, clock)
            if not all_of.seconds.size:
                continue
            drawn[clock] = {"n": all_of.seconds.size}
            for name, some in (("all", all_of), ("cut", all_of.cut())):
                at = extremes(some.seconds, buckets, group=some.tick)
                drawn[clock][name] = {"i": some.tick[at].tolist(), "y": rounded(1e6 * some.seconds[at])}
            shares, seconds = distribution(all_of.seconds)
            drawn[clock]["cdf"] = {"x": rounded(1e6 * seconds), "y": rounded(shares, 6)}
    return drawn


def packed(content: object) -> str:
    """JSON, gzipped, in base64; the same content gives the same text."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


def rounded(values: ArrayLike, digits: int = _DIGITS) -> list[float | None]:
    """Values to so many significant digits, None where they aren't finite."""
    return [float(f"{x:.{digits}g}") if np.isfinite(x) else None for x in np.asarray(values, dtype=np.float64).tolist()]


def _curve(tick: Index, values: Array, buckets: int) -> dict[str, list[Any]]:
    at = extremes(values, buckets)
    return {"i": tick[at].tolist(), "y": rounded(values[at])}


def _phase(ticks: pl.DataFrame, scenario: Scenario, joint: int, buckets: int) -> dict[str, Any]:
    """Position, velocity and the bounds that held, at the extremes of both."""
    unit, scale = unit_of(scenario, joint)
    q, qd = (vectors(ticks, name)[:, joint] * scale for name in ("q", "qd"))
    low, high = (vectors(ticks, name)[:, joint] * scale for name in ("qd_lo", "qd_hi"))
    at = np.unique(np.concatenate([extremes(q, buckets // 2 + 1), extremes(qd, buckets // 2 + 1)]))
    return {
        "unit": unit,
        **{name: rounded(x[at]) for name, x in (("q", q), ("qd", qd), ("lo", low), ("hi", high))},
    }
