"""The search: random, then local, in batches through the compiled step; and the slowest tick among what it finds."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from ...solvers.active_set import STATUSES
from ..conditions import conditions
from .case import Found, WorstCase
from .states import Batch, Draws
from .timing import Stopwatch

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...codegen import CompiledStep

_BATCH: Final = 20_000
_LOCAL_BATCH: Final = 4_000
# Share of the ticks spent on states drawn anywhere, before those near the worst ones.
_RANDOM_SHARE: Final = 0.5
# The worst states kept to search near, and how many of them may have the same active rows.
_KEPT: Final = 48
_ALIKE: Final = 2
# Timed: states drawn anywhere, the worst ones kept, and states near the slowest of all these, in rounds.
_TYPICAL: Final = 60
_SLOWEST: Final = 6
_NEIGHBOURS: Final = 8
_ROUNDS: Final = 2


@dataclass(frozen=True)
class _Kept:
    iterations: int
    active: bytes
    state: Batch


def search(
    step: CompiledStep,
    *,
    ticks: int = 1_000_000,
    seed: int = 0,
    on_progress: Callable[[int, int, int], None] | None = None,
    on_found: Callable[[WorstCase], None] | None = None,
) -> WorstCase:
    """Search for the state with most iterations and for the slowest tick.

    Half of the ticks are states drawn anywhere (see `Draws`), under the robot's own limits and under tighter ones; the
    other half lie near the worst states found, of different active rows. Then ticks are timed, see `Stopwatch`: of
    typical states, the worst ones found, and states near the slowest of them.

    Parameters
    ----------
    step : CompiledStep
    ticks : int
        How many states are solved for the search by iterations.
    seed : int
        The same seed finds the same states by iterations; times are the machine's.
    on_progress : callable, optional
        A KeyboardInterrupt raised in it, or anywhere here, ends the search with what was found so far.
    on_found : callable, optional
        Called with the case before anything is timed, which may take as long as the search: to be written down.

    Returns
    -------
    WorstCase

    Raises
    ------
    ValueError
        When there are too few ticks to search.
    """
    if ticks < 1:
        raise ValueError(f"ticks: expected at least 1, got {ticks}")
    rng = np.random.default_rng(seed)
    draws = Draws(step, rng)
    statuses: Counter[str] = Counter()
    kept: list[_Kept] = []
    done, interrupted = 0, False
    try:
        while done < ticks:
            local = done >= _RANDOM_SHARE * ticks and bool(kept)
            count = min(_LOCAL_BATCH if local else _BATCH, ticks - done)
            if local:
                batch = draws.near(kept[int(rng.integers(len(kept)))].state, count)
            else:
                batch = draws.anywhere(count, draws.limits())
            kept = _worst(kept, step, batch, statuses)
            done += count
            if on_progress is not None:
                on_progress(done, ticks, kept[0].iterations)
    except KeyboardInterrupt:
        if not kept:
            raise
        interrupted = True
    most = Found.of(step, kept[0].state, None)
    found = WorstCase(
        robot=step.robot.name,
        tip=None,
        formulation=step.formulation.name,
        mode=str(step.mode),
        most=most,
        slowest=most,
        median=None,
        statuses=dict(statuses),
        ticks=done,
        seed=seed,
        conditions=conditions(),
    )
    if on_found is not None:
        on_found(found)
    try:
        return _timed(found, step, draws, kept, 0 if interrupted else _ROUNDS)
    except KeyboardInterrupt:
        return found


def _timed(found: WorstCase, step: CompiledStep, draws: Draws, kept: list[_Kept], rounds: int) -> WorstCase:
    watch, most = Stopwatch(step, found.seed), kept[0].state
    slowest, median = _slowest(watch, draws, [each.state for each in kept], rounds)
    seconds, again = watch.seconds([most, slowest])
    return replace(found, most=Found.of(step, most, seconds), slowest=Found.of(step, slowest, again), median=median)


def _slowest(watch: Stopwatch, draws: Draws, worst: list[Batch], rounds: int) -> tuple[Batch, float]:
    """Find the slowest tick: typical ones, the worst ones, some near the slowest; with a typical one's time [s]."""
    typical = draws.anywhere(_TYPICAL, {})
    states = [typical.pick(index) for index in range(len(typical))]
    times = watch.seconds(states)
    median = float(np.median(times))
    states, times = [*states, *worst], [*times, *watch.seconds(worst)]
    for _ in range(rounds):
        slowest = sorted(range(len(states)), key=lambda i: -times[i])[:_SLOWEST]
        near = [draws.near(states[i], _NEIGHBOURS) for i in slowest]
        fresh = [batch.pick(i) for batch in near for i in range(len(batch))]
        states, times = [*states, *fresh], [*times, *watch.seconds(fresh)]
    # A minimum over few repeats still has luck in it: the last word is among the first few, timed once more.
    finalists = sorted(range(len(states)), key=lambda i: -times[i])[:_SLOWEST]
    again = watch.seconds([states[i] for i in finalists])
    return states[finalists[int(np.argmax(again))]], median


def _worst(kept: list[_Kept], step: CompiledStep, batch: Batch, statuses: Counter[str]) -> list[_Kept]:
    result = step.batch(batch.q, batch.v, **batch.inputs(step))
    codes, counts = np.unique(result.codes, return_counts=True)
    for code, count in zip(codes, counts, strict=True):
        statuses[STATUSES[code].value] += int(count)
    order = np.argsort(-result.iterations, kind="stable")[: 4 * _KEPT]
    found = [_Kept(int(result.iterations[i]), result.sides[i].tobytes(), batch.pick(int(i))) for i in order]
    alike: Counter[bytes] = Counter()
    best: list[_Kept] = []
    for each in sorted([*kept, *found], key=lambda each: -each.iterations):
        alike[each.active] += 1
        if alike[each.active] <= _ALIKE:
            best.append(each)
    return best[:_KEPT]
