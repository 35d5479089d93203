"""Calls from Python: a batch beside the C loop, single calls beside Pink."""

from __future__ import annotations

from time import perf_counter_ns
from typing import TYPE_CHECKING, Final

import numpy as np

from kinqp.codegen import compile_step

from .comparison import REPEATS
from .pink_ik import PinkStep, pink_solvers
from .states import MODE, States, arm
from .table import Report, median, spread
from .tick import WHOLE, TimedTick

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinqp.codegen import CompiledStep

    Array = NDArray[np.float64]

BATCH: Final = 100_000
MILLION: Final = 1_000_000
CALLS: Final = 100  # Python calls a repeat


def from_python(formulation: str, states: States, report: Report, flags: Sequence[str]) -> None:
    """Time calls from Python: batch beside the C loop, single calls beside Pink."""
    step = compile_step(arm(), formulation, MODE)
    tick = TimedTick(arm(), formulation, MODE, states, WHOLE, flags)
    q, v = _repeated(states, BATCH)
    ratios, seconds = [], []
    for _ in range(REPEATS):
        c = tick.loop(q, v)
        python = _batch_time(step, q, v)
        ratios.append(python / c)
        seconds.append((python * 1e-9, c * 1e-9))
    r = np.array(ratios)
    mine, loop = np.median(seconds, axis=0)
    figures = (f"{mine * 1e9 / BATCH:.0f} ns", f"{loop * 1e9 / BATCH:.0f} ns")
    report.below(f"{formulation}: batch / C loop, per tick", states.name, figures, median(r), 1.1, spread(r))
    q, v = _repeated(states, MILLION)
    million = np.array([_batch_time(step, q, v) * 1e-9 for _ in range(3)])
    report.below(f"{formulation}: batch of a million [s]", states.name, ("", ""), float(million.min()), 0.4)

    pink = PinkStep(arm())
    rng = np.random.default_rng(0)
    solver = min(pink_solvers(), key=lambda name: median(_pink_times(pink, states, name, np.arange(20))))
    ratios, medians = [], []
    for _ in range(REPEATS):
        index = rng.integers(0, len(states.q), CALLS)
        theirs = median(_pink_times(pink, states, solver, index))
        ours = median(_step_times(step, states, index))
        ratios.append(ours / theirs)
        medians.append((ours, theirs))
    r = np.array(ratios)
    mine, theirs = np.median(medians, axis=0)
    figures = (f"{mine / 1e3:.1f} us", f"{theirs / 1e3:.0f} us")
    report.below(f"{formulation}: step(q, v) / pink ({solver})", states.name, figures, median(r), 1 / 30, spread(r))


def _pink_times(pink: PinkStep, states: States, solver: str, index: NDArray[np.int64]) -> Array:
    return np.array([pink.time(states.q[i], states.v[i], solver) for i in index], dtype=float)


def _step_times(step: CompiledStep, states: States, index: NDArray[np.int64]) -> Array:
    found = []
    for i in index:
        q, v = states.q[i], states.v[i]
        start = perf_counter_ns()
        step(q, v)
        found.append(perf_counter_ns() - start)
    return np.array(found, dtype=float)


def _batch_time(step: CompiledStep, q: Array, v: Array) -> float:
    start = perf_counter_ns()
    step.batch(q, v)
    return float(perf_counter_ns() - start)


def _repeated(states: States, count: int) -> tuple[Array, Array]:
    index = np.arange(count) % len(states.q)
    return states.q[index], states.v[index]
