"""One cell as one flat record: everything that the report, `compare` and the scorecard say of it."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any

from .against import AgainstHand
from .behaviour import Answers, Errors, Iterations, Motion
from .intervals import Estimate
from .requirements import requirement_values
from .ticks import Ticks
from .timing import CellTimes

if TYPE_CHECKING:
    import polars as pl

    from ..scenarios import Scenario


@dataclass(frozen=True)
class CellRecord:
    """Everything about one cell; `flat` gives it as a dict of numbers and words.

    Attributes
    ----------
    scenario, formulation, solver, start : str
        Which cell.
    expects : str
        The scenario's right answer.
    ticks : int
        Of its accuracy part.
    loop : {"closed", "states", "sampled"}
        Whether they are the solver's own closed loop, states that have nothing to do with each other, or a sample of
        the reference's states.
    times : CellTimes
    iterations : Iterations
    answers : Answers
    errors : Errors
    motion : Motion
    hand : AgainstHand
    requirement : dict of str to float
        The ten of the thesis, by key; see `REQUIREMENTS`.
    """

    scenario: str
    formulation: str
    solver: str
    start: str
    expects: str
    ticks: int
    loop: str
    times: CellTimes
    iterations: Iterations
    answers: Answers
    errors: Errors
    motion: Motion
    hand: AgainstHand
    requirement: dict[str, float | None]

    def flat(self) -> dict[str, str | int | float | None]:
        """Give all of it by the parts' names, as in `wall_p95_low`, `requirement_drift`; None for nothing."""
        out: dict[str, str | int | float | None] = {}
        for field in fields(self):
            # What a cell's numbers are about needs no prefix; times and requirements have their own.
            prefix = "requirement" if field.name == "requirement" else ""
            value = getattr(self, field.name)
            _flatten(out, prefix if is_dataclass(value) or isinstance(value, dict) else field.name, value)
        return out


def cell_record(
    ticks: pl.DataFrame,
    times: pl.DataFrame | None,
    scenario: Scenario,
    *,
    formulation: str = "",
    solver: str = "",
    start: str = "",
    seed: int = 0,
) -> CellRecord:
    """Turn a cell's two frames into its record.

    Parameters
    ----------
    ticks : pl.DataFrame
        Its accuracy part, one row per tick.
    times : pl.DataFrame, optional
        Its timing part, one row per tick and repeat.
    scenario : Scenario
        What was run.
    formulation, solver, start : str
        What the cell is called.
    seed : int
        Of the bootstrap.

    Raises
    ------
    FrameError
        When a column is missing, or the rows are not the scenario's ticks.
    """
    cell = Ticks(scenario, ticks)
    return CellRecord(
        scenario=scenario.name,
        formulation=formulation,
        solver=solver,
        start=start,
        expects=scenario.expects.value,
        ticks=len(ticks),
        loop=cell.loop,
        times=CellTimes.of(times, seed=seed),
        iterations=Iterations.of(cell),
        answers=Answers.of(cell),
        errors=Errors.of(cell),
        motion=Motion.of(cell),
        hand=AgainstHand.of(cell),
        requirement=requirement_values(cell),
    )


def _flatten(out: dict[str, str | int | float | None], name: str, value: Any) -> None:
    if isinstance(value, Estimate):
        out |= {name: value.value, f"{name}_low": value.low, f"{name}_high": value.high}
    elif is_dataclass(value):
        for field in fields(value):
            _flatten(out, f"{name}_{field.name}" if name else field.name, getattr(value, field.name))
    elif isinstance(value, dict):
        for key, entry in value.items():
            _flatten(out, f"{name}_{key}", entry)
    else:
        out[name] = value
