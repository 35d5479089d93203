"""Our tick, its QP alone and DAQP on the same states, in turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from .states import MODE, States, arm
from .table import spread
from .tick import PROFILE, QP, WHOLE, TimedTick

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .problems import Problems

    Array = NDArray[np.float64]

FORMULATIONS: Final = ("cartesian-error", "joint-space")
REPEATS: Final = 20
LIKE: Final = 500  # states a repeat when both are called from the interpreter


@dataclass
class Measured:
    """Times of one formulation on one set of states, per state and per repeat's block [ns]."""

    formulation: str
    data: str
    blocks: list[slice]
    constrained: NDArray[np.bool_]
    whole: Array
    qp: Array
    solve: Array
    both: Array
    stages: Array
    iterations: NDArray[np.intc]
    failed: int
    daqp_failures: int

    def ratio(self, ours: Array, other: Array, *, constrained: bool) -> Array:
        """Ratio of the medians of each repeat's states."""
        picked = [self._of(block, constrained=constrained) for block in self.blocks]
        return np.array([np.median(ours[index]) / np.median(other[index]) for index in picked if index.size])

    def percentile(self, times: Array, share: float, *, constrained: bool) -> float:
        """Percentile over all states."""
        return float(np.percentile(times[self._of(slice(None), constrained=constrained)], share))

    def _of(self, block: slice, *, constrained: bool) -> NDArray[np.intp]:
        index = np.arange(len(self.whole))[block]
        return index[self.constrained[index]] if constrained else index


def measure(formulation: str, states: States, problems: Problems, passes: int, flags: Sequence[str]) -> Measured:
    """Time the tick, its QP alone and DAQP on the same states, in turns."""
    whole, qp = (TimedTick(arm(), formulation, MODE, states, level, flags) for level in (WHOLE, QP))
    blocks = [slice(first, None, REPEATS) for first in range(REPEATS)]
    count = len(states.q)
    times = {name: np.full(count, np.inf) for name in ("whole", "qp")}
    for block in blocks:
        whole.reset()
        qp.reset()
        for _ in range(passes):
            whole.passes()
            problems.passes(block)
            qp.passes()
        times["whole"][block] = whole.whole()[block]
        times["qp"][block] = qp.qp()[block]
    staged = TimedTick(arm(), formulation, MODE, states, PROFILE, flags)
    for _ in range(passes):
        staged.passes()
    return Measured(
        formulation=formulation,
        data=states.name,
        blocks=blocks,
        constrained=whole.iterations > 0,
        whole=times["whole"],
        qp=times["qp"],
        solve=problems.solve.copy(),
        both=problems.both.copy(),
        stages=staged.stages(),
        iterations=whole.iterations.copy(),
        failed=int(np.sum(whole.status != 0)),
        daqp_failures=problems.failures,
    )


def like_for_like(
    formulation: str, states: States, problems: Problems, passes: int, flags: Sequence[str]
) -> tuple[str, ...]:
    """Time ours as DAQP's wheel is timed: one state at a time, with the interpreter's work in between."""
    whole, qp = (TimedTick(arm(), formulation, MODE, states, level, flags) for level in (WHOLE, QP))
    ratios, medians = [], []
    for repeat in range(REPEATS):
        block = slice(repeat * LIKE, (repeat + 1) * LIKE)
        problems.reset()
        for _ in range(passes):
            found = []
            for index in range(len(states.q))[block]:
                whole.one(index)
                found.append(problems.one(index)[:2])
                qp.one(index)
            if found:
                problems.keep(block, found)
        tick, both = whole.whole()[block], problems.both[block]
        held = whole.iterations[block] > 0
        if not held.any():
            continue
        ratios.append(np.median(tick) / np.median(both))
        columns = (tick, qp.qp()[block][held], problems.solve[block][held], both)
        medians.append([np.median(column) for column in columns])
    shown = np.median(medians, axis=0)
    return (formulation, *(f"{value:.0f}" for value in shown), f"{np.median(ratios):.3f}{spread(np.array(ratios))}")
