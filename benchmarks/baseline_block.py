"""Both parts of a baseline's cell: its closed loop, and the time that its closed form takes."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Final

from ..baselines import BaselineStep, get_baseline
from .loop import each_tick, fixed_inputs, remembered, row_of, to_frame
from .problems import choose_windows, ticks_of
from .scenarios import get_scenario
from .situations import Situations
from .store import Part
from .visits import Visits, affordable, no_rows

if TYPE_CHECKING:
    from typing import Any

    import numpy as np
    import polars as pl
    from numpy.typing import NDArray

    from ..baselines import Situation
    from ..formulations import StepResult
    from .begun import Progress
    from .cells import Block, Cell
    from .config import SweepConfig
    from .loop import State
    from .problems import Window

    Array = NDArray[np.float64]

_NOTES: Final = ("own and c are null: a closed form has no timer of its own, and no C here",)


class BaselineBlock:
    """A baseline on a scenario: its closed loop, run once, and the situations that it is timed on.

    There is no reference to compare with, and no solver to be judged: `status` says whether the baseline did what it
    promises (`kinqp.baselines.BaselineStep`), and as it always claims that, a tick at which it did not counts as
    claimed solved, and was not.

    Parameters
    ----------
    block : Block
    config : SweepConfig

    Attributes
    ----------
    problems : Situations
        States of its own run, at those ticks at which a formulation's QPs would be recorded.
    """

    def __init__(self, block: Block, config: SweepConfig) -> None:
        scenario = get_scenario(block.scenario)
        steps = _Steps(block)
        windows = choose_windows(scenario.ticks, config.timing_ticks, config.timing_window, config.seed)
        wanted = set(ticks_of(windows))
        states: dict[int, State] = {}
        rows = []
        for state, result in each_tick(scenario, steps.resolve):
            at = steps.at(state)
            rows.append(row_of(scenario, state, result, (at.qd_lo, at.qd_hi)))
            if state.tick in wanted:
                states[state.tick] = state
        loop = "states" if scenario.states is not None else "closed"
        self._result: Final = to_frame(rows, scenario), Part("done", loop=loop, ticks=len(rows), repeats=1)
        self.problems: Final = Situations(windows, states)

    def run(self, cell: Cell) -> tuple[pl.DataFrame, Part]:  # noqa: ARG002  # as of a formulation's block
        """Return the ticks of the block's only cell, see `to_frame`, and how it ended."""
        return self._result


class TimedBaseline:
    """A baseline that visits recorded situations; as `kinqp.benchmarks.replay.TimedCell`.

    What is timed is `Baseline.resolve`: rows, bounds and what else it is given are there before, as a QP is before a
    solver is timed. Its decompositions are in the span, those of a formulation's lowering are not.

    Parameters
    ----------
    cell : Cell
    situations : Situations
        The block's.
    config : SweepConfig
    begun : Progress, optional
        What an earlier process came to.
    """

    def __init__(self, cell: Cell, situations: Situations, config: SweepConfig, begun: Progress | None = None) -> None:
        steps = _Steps(cell.block)
        self._baseline: Final = get_baseline(cell.formulation)
        self._situations: Final = {tick: steps.observe(state) for tick, state in situations.states.items()}
        self._windows: Final = (
            begun.windows
            if begun
            else affordable(
                situations.windows,
                config.timing_budget / config.repeats,
                lambda window: self._window(window, no_rows(), []),
            )
        )
        self.visits: Final = Visits(begun)

    def visit(self, repeat: int) -> None:
        """Resolve all situations once, and keep the times."""
        rows = no_rows()
        answers: list[Array] = []
        for window in self._windows:
            self._window(window, rows, answers)
        self.visits.add(repeat, rows, answers)

    def result(self) -> tuple[pl.DataFrame, Part]:
        """All times, in the columns of `TimedCell.result`: an update of zero, and no set-up; and how the cell ended."""
        return self.visits.result(sum(len(window.ticks) for window in self._windows), _NOTES)

    def progress(self) -> Progress:
        """How far it has come."""
        return self.visits.progress(self._windows)

    def _window(self, window: Window, rows: dict[str, list[float | int | None]], answers: list[Array]) -> None:
        for tick in (window.lead, *window.ticks):
            # What a situation works out when asked it keeps: a copy has nothing of the last visit's.
            at = replace(self._situations[tick])
            start = perf_counter()
            resolved = self._baseline.resolve(at)
            seconds = perf_counter() - start
            answers.append(resolved.qd)
            if tick != window.lead:
                for name, value in (("tick", tick), ("wall_setup", None), ("wall_update", 0.0), ("own", None)):
                    rows[name].append(value)
                rows["wall_solve"].append(seconds)


class _Steps:
    """A baseline's steps in all modes of a scenario, with the scenario's inputs."""

    def __init__(self, block: Block) -> None:
        scenario, baseline = get_scenario(block.scenario), get_baseline(block.formulation)
        self._steps: Final = {mode: BaselineStep(scenario.robot, baseline, mode) for mode in scenario.modes}
        self._inputs: Final = {mode: fixed_inputs(block, scenario, step) for mode, step in self._steps.items()}

    def resolve(self, state: State) -> StepResult:
        return self._steps[state.mode](state.q, state.v, **self._given(state))

    def observe(self, state: State) -> Situation:
        return self._steps[state.mode].observe(state.q, state.v, **self._given(state))

    def at(self, state: State) -> Situation:
        """What was resolved last, in the mode of `state`."""
        situation = self._steps[state.mode].situation
        assert situation is not None, "resolved before"  # noqa: S101  # a mistake of ours, if ever
        return situation

    def _given(self, state: State) -> dict[str, Any]:
        return {**self._inputs[state.mode], **remembered(self._steps[state.mode], state)}
