"""The sweep: every cell run in closed loop, timed runs in random interleaved order."""

from __future__ import annotations

import gc
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..control import make_step, simulate
from .conditions import conditions
from .config import SweepConfig, make_config
from .scenarios import Scenario, get_scenario
from .store import Cell, Store, cells_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from ..baselines import BaselineStep
    from ..control import InterpretedStep, Trajectory


def sweep(
    config: SweepConfig | Mapping[str, object] | None = None,
    out: str | Path = "results",
    *,
    resume: bool = False,
    overwrite: bool = False,
    on_progress: Callable[[int, int, str], None] | None = None,
) -> Store:
    """Run a sweep.

    Every repeat visits all cells in a new random order, so that a machine that slows down or speeds up does so for all
    of them; each visit runs the scenario's whole closed loop with a new solver, after a warm-up whose ticks are thrown
    away. A cell's file is replaced after each of its runs: interrupted, the folder keeps all runs done.

    Parameters
    ----------
    config : SweepConfig or mapping, optional
        What to run; the shipped default without it.
    out : str or Path
        Results folder.
    resume : bool
        Continue the sweep in `out`, where there is one.
    overwrite : bool
        Replace it.
    on_progress : callable, optional
        Called with (runs done, runs in all, the cell to run next or "").

    Returns
    -------
    Store
        The results folder.

    Raises
    ------
    ConfigError
        Naming the key of `config` that is not usable.
    StoreError
        When `out` can't be used as asked.
    """
    if not isinstance(config, SweepConfig):
        config = make_config(dict(config or {}))
    store = Store(Path(out))
    store.begin(config, conditions(), resume=resume, overwrite=overwrite)
    pending = list(_schedule(config, {cell: store.repeats_done(cell) for cell in cells_of(config)}))
    total = len(cells_of(config)) * config.repeats
    scenarios = {name: get_scenario(name) for name in config.scenarios}
    steps: dict[Cell, InterpretedStep | BaselineStep] = {}
    for done, cell in enumerate(pending, start=total - len(pending)):
        if on_progress is not None:
            on_progress(done, total, str(cell))
        scenario = scenarios[cell.scenario]
        if cell not in steps:
            steps[cell] = make_step(scenario.robot, cell.formulation, scenario.mode, cell.solver)
        store.add(cell, timed_run(steps[cell], scenario, config.warm_up))
    if on_progress is not None:
        on_progress(total, total, "")
    return store


def timed_run(step: InterpretedStep | BaselineStep, scenario: Scenario, warm_up: int) -> Trajectory:
    """Run a scenario's closed loop once, after `warm_up` ticks that don't count.

    The solver forgets its set-up between the two: the first tick's `setup_time` is that of a full set-up, all others
    are updates.
    """
    if warm_up:
        ticks = max(2, min(warm_up, round(scenario.duration / scenario.dt)))
        simulate(step, scenario.guide, scenario.q0, ticks * scenario.dt, dt=scenario.dt)
    step.solver.reset()
    with _no_garbage_collection():
        return simulate(step, scenario.guide, scenario.q0, scenario.duration, dt=scenario.dt)


def _schedule(config: SweepConfig, done: dict[Cell, int]) -> Iterator[Cell]:
    """Cells in the order they are to be run: repeat by repeat, shuffled within each; runs done before left out."""
    rng = np.random.default_rng(config.seed)
    cells = list(done)
    for repeat in range(config.repeats):
        for index in rng.permutation(len(cells)):
            if done[cells[index]] <= repeat:
                yield cells[index]


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Keep the interpreter's garbage collector out of the timed span; it would strike single ticks at random."""
    was_enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
