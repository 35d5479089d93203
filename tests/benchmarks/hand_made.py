"""Cells small enough to work out by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl

from kinqp.benchmarks import Scenario, get_scenario

NV = 7
ELBOW = 3


def scenario(ticks: int, **changes: Any) -> Scenario:
    """The semicircle cut to so many ticks: orientation locked, the elbow watched, 1 ms, all at rest at q = 0."""
    whole = get_scenario("semicircle")
    phase = replace(whole.only_phase, duration=ticks * whole.dt)
    return replace(whole, name="by-hand", phases=(phase,), **changes)


def column(ticks: int, joint: int = ELBOW, values: Any = 0.0) -> np.ndarray:
    """One joint's values over time, the others at zero."""
    out = np.zeros((ticks, NV))
    out[:, joint] = values
    return out


def ticks_frame(ticks: int, **columns: Any) -> pl.DataFrame:
    """An unremarkable cell of so many ticks, with some columns in place of its own."""
    whole: dict[str, Any] = {
        "t": np.arange(ticks) * 1e-3,
        "phase": np.zeros(ticks, dtype=int),
        "q": column(ticks),
        "qd": column(ticks),
        "qd_lo": column(ticks) - 1.0,
        "qd_hi": column(ticks) + 1.0,
        "v": np.zeros((ticks, 3)),
        "eps": np.zeros((ticks, 3)),
        "status": ["solved"] * ticks,
        "claimed": ["solved"] * ticks,
        "iterations": np.ones(ticks, dtype=int),
        "active": [[]] * ticks,
        "fixed_error": np.zeros(ticks),
        "bound_violation": np.zeros(ticks),
        "sigma_min": np.ones(ticks),
        "task_scale": np.full(ticks, np.nan),
        "reference_error": np.zeros(ticks),
        "setup_time": np.zeros(ticks),
        "update_time": np.zeros(ticks),
        "solve_time": np.zeros(ticks),
    }
    assert set(columns) <= set(whole)
    made = {}
    for name, values in (whole | columns).items():
        values = values.tolist() if isinstance(values, np.ndarray) else values
        made[name] = pl.Series(values, dtype=pl.List(pl.String)) if name == "active" else pl.Series(values)
    return pl.DataFrame(made)


def times_frame(repeats: int, update: list[float], solve: list[float], **columns: Any) -> pl.DataFrame:
    """Times of ticks that are the same in every repeat."""
    ticks = len(update)
    whole: dict[str, Any] = {
        "tick": np.tile(np.arange(ticks), repeats),
        "repeat": np.repeat(np.arange(repeats), ticks),
        "wall_setup": [None] * (ticks * repeats),
        "wall_update": update * repeats,
        "wall_solve": solve * repeats,
        "own": [None] * (ticks * repeats),
        "c": [None] * (ticks * repeats),
    }
    return pl.DataFrame(whole | columns)


def corner() -> Scenario:
    """`limit-corner` up to where the hand pulls sideways."""
    whole = get_scenario("limit-corner")
    return replace(whole, name="corner", phases=(replace(whole.only_phase, duration=0.7),))
