"""How long single ticks take, so that it is the tick that is found slow and not the machine."""

from __future__ import annotations

import gc
from time import perf_counter
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...codegen import CompiledStep
    from .states import Batch

# Copies of a state in one call into C: what the call itself costs, some ten microseconds, is less than 1 % of them.
_COPIES: Final = 2_000
_REPEATS: Final = 5


class Stopwatch:
    """Times ticks: the same state thousands of times in one call into C, the fastest of some calls.

    The calls for all states are made in random order, so that a slow moment of the machine strikes no state twice; the
    fastest of its calls is what a state's tick takes with caches warm and branches foreseen. Interrupts, other
    processes and cold caches come on top in practice: the search is for states, not for them.

    Parameters
    ----------
    step : CompiledStep
    seed : int
        Of the order.
    """

    def __init__(self, step: CompiledStep, seed: int) -> None:
        self._step: Final = step
        self._rng: Final = np.random.default_rng(seed)

    def seconds(self, states: Sequence[Batch]) -> list[float]:
        """Time a tick at each of the states [s]."""
        fastest = np.full(len(states), np.inf)
        was_enabled = gc.isenabled()
        gc.disable()
        try:
            for _ in range(_REPEATS):
                for index in self._rng.permutation(len(states)):
                    many = states[index].repeated(_COPIES)
                    inputs = many.inputs(self._step)
                    start = perf_counter()
                    self._step.batch(many.q, many.v, **inputs)
                    fastest[index] = min(fastest[index], (perf_counter() - start) / _COPIES)
        finally:
            if was_enabled:
                gc.enable()
        return [float(value) for value in fastest]
