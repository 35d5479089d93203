"""The timing part: a block's recorded problems solved again and again by all its cells, visits in random order."""

from __future__ import annotations

import gc
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

import numpy as np

from .baseline_block import TimedBaseline
from .cells import solver_of
from .situations import Situations
from .timing_c import c_replay
from .visits import Visits, affordable, no_rows

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import polars as pl
    from numpy.typing import NDArray

    from ..solvers import QP, Solution
    from .begun import Progress
    from .cells import Cell
    from .config import SweepConfig
    from .problems import Problems, Window
    from .store import Part

    Array = NDArray[np.float64]

_NO_C: Final = "c is null: no C of this solver is replayed"
_NO_OWN: Final = "own is null: the solver has no timer of its own"


class TimedCell:
    """A solver that visits recorded problems.

    Parameters
    ----------
    cell : Cell
    problems : Problems
        The block's.
    config : SweepConfig
    begun : Progress, optional
        What an earlier process came to.
    """

    def __init__(self, cell: Cell, problems: Problems, config: SweepConfig, begun: Progress | None = None) -> None:
        self.cell: Final = cell
        self._problems: Final = problems
        self._solver: Final = solver_of(cell)
        self._c: Final = c_replay(self._solver)
        self.visits: Final = Visits(begun)
        # The first call of all may import, build and allocate.
        self._solver.solve(problems.qps[problems.windows[0].lead][0])
        self._windows: Final = (
            begun.windows
            if begun
            else affordable(
                problems.windows,
                config.timing_budget / config.repeats,
                lambda window: self._window(window, no_rows(), []),
            )
        )
        self._sequence: Final = [qp for window in self._windows for qp in self._qps(window)]
        self._fresh: Final = _fresh(self._windows, problems.qps)

    def visit(self, repeat: int) -> None:
        """Solve all problems once, and keep the times."""
        rows = no_rows()
        answers: list[Array] = []
        for window in self._windows:
            self._window(window, rows, answers)
        times = self._c.seconds(self._sequence, self._fresh) if self._c is not None else None
        c = None if times is None else _per_tick(times, self._windows, self._problems.qps)
        self.visits.add(repeat, rows, answers, c)

    def result(self) -> tuple[pl.DataFrame, Part]:
        """All times, one tick of one repeat per row, and how the cell ended.

        Columns: `tick`, `repeat`; `wall_setup` of a window's first tick, `wall_update` of all others (null for the
        other kind); `wall_solve`; `own`, the solver's own timer; `c`, the solve in C; all [s].
        """
        frame = self.visits.frame()
        notes = [text for name, text in (("own", _NO_OWN), ("c", _NO_C)) if frame[name].null_count() == len(frame)]
        if frame["own"].null_count() < len(frame):
            notes.append(f"own is {self._solver.own_timer}")
        return self.visits.result(sum(len(window.ticks) for window in self._windows), notes)

    def progress(self) -> Progress:
        """How far it has come."""
        return self.visits.progress(self._windows)

    def _window(self, window: Window, rows: dict[str, list[float | int | None]], answers: list[Array]) -> None:
        solver = self._solver
        solver.reset()
        for index, tick in enumerate((window.lead, *window.ticks)):
            solutions = [solver.solve(qp) for qp in self._problems.qps[tick]]
            answers += [solution.x for solution in solutions]
            setup = sum(solution.setup_time for solution in solutions)
            rows["tick"].append(tick)
            rows["wall_setup"].append(setup if index == 0 else None)
            rows["wall_update"].append(None if index == 0 else setup)
            rows["wall_solve"].append(sum(solution.solve_time for solution in solutions))
            rows["own"].append(_own(solutions))

    def _qps(self, window: Window) -> list[QP]:
        return [qp for tick in (window.lead, *window.ticks) for qp in self._problems.qps[tick]]


def time_block(
    problems: Problems | Situations,
    cells: Sequence[Cell],
    config: SweepConfig,
    on_visit: Callable[[Cell, int], None],
    on_failure: Callable[[Cell, str], None],
    *,
    begun: Mapping[str, Progress] | None = None,
    on_progress: Callable[[Callable[[], dict[str, Progress]]], None] | None = None,
) -> Iterator[tuple[Cell, pl.DataFrame, Part]]:
    """Time a block's cells beside each other.

    Every repeat visits all cells in a new random order, so that a machine that slows down or speeds up does so for all
    of them. To be called in a process that has nothing else to do.

    Parameters
    ----------
    problems : Problems or Situations
        The block's; situations of a baseline's.
    cells : sequence of Cell
        Of the block.
    config : SweepConfig
    on_visit : callable
        Called with a cell and the number of the repeat before each visit; -1: before it is made ready.
    on_failure : callable
        Called with a cell that raised and what it said; it is not visited again.
    begun : mapping of str to Progress, optional
        What an earlier process came to, by the cells' files' stems. Its visits count, and the rest follow: in the same
        order, but beside those of the earlier process only as far as the machine is still in the same state.
    on_progress : callable, optional
        Called after each visit with a function that gives all cells' progress; nothing is timed meanwhile.

    Yields
    ------
    tuple of Cell, pl.DataFrame, Part
        As `TimedCell.result` has them, when all are done.
    """
    timed: dict[Cell, TimedCell | TimedBaseline] = {}
    begun = begun or {}
    with _no_garbage_collection():
        for repeat in range(-1, config.repeats):
            # Sorted and of a seed of its own, so that a continuation takes the rest in the order of the whole.
            order = np.random.default_rng((config.seed, repeat + 1)).permutation(len(cells))
            for cell in (sorted(cells)[index] for index in order):
                if repeat >= 0 and (cell not in timed or repeat < timed[cell].visits.repeats):
                    continue
                on_visit(cell, repeat)
                try:
                    if repeat < 0:
                        timed[cell] = _timed(cell, problems, config, begun.get(cell.file_stem))
                    else:
                        timed[cell].visit(repeat)
                except Exception as error:  # noqa: BLE001  # whatever a solver raises ends this cell, not the others
                    timed.pop(cell, None)
                    on_failure(cell, f"{type(error).__name__}: {error}")
                if on_progress is not None and repeat >= 0:
                    on_progress(lambda: {cell.file_stem: one.progress() for cell, one in timed.items()})
    for cell, one in timed.items():
        yield cell, *one.result()


def _timed(
    cell: Cell, problems: Problems | Situations, config: SweepConfig, begun: Progress | None
) -> TimedCell | TimedBaseline:
    if isinstance(problems, Situations):
        return TimedBaseline(cell, problems, config, begun)
    return TimedCell(cell, problems, config, begun)


def _fresh(windows: Sequence[Window], qps: dict[int, tuple[QP, ...]]) -> list[bool]:
    """Where a solver sets up anew: at the beginning of a window, and where the structure changes."""
    fresh: list[bool] = []
    for window in windows:
        last: object = None
        for tick in (window.lead, *window.ticks):
            for qp in qps[tick]:
                fresh.append(qp.structure != last)
                last = qp.structure
    return fresh


def _per_tick(times: Array, windows: Sequence[Window], qps: dict[int, tuple[QP, ...]]) -> list[float]:
    """Add up the levels of each tick."""
    counts = [len(qps[tick]) for window in windows for tick in (window.lead, *window.ticks)]
    starts = np.cumsum([0, *counts[:-1]])
    return [float(total) for total in np.add.reduceat(times, starts)]


def _own(solutions: Sequence[Solution]) -> float | None:
    own = [solution.own_time for solution in solutions]
    return None if any(time is None for time in own) else float(sum(time for time in own if time is not None))


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
