"""A results folder as the report reads it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..scenarios import Scenario, get_scenario

if TYPE_CHECKING:
    import polars as pl

    from ..cells import Cell
    from ..store import Outcome, Store


@dataclass(frozen=True)
class Case:
    """A cell, how it ended, and where its frames are.

    Attributes
    ----------
    cell : Cell
    scenario : Scenario
    outcome : Outcome
    store : Store
    """

    cell: Cell
    scenario: Scenario
    outcome: Outcome
    store: Store

    def ticks(self) -> pl.DataFrame | None:
        """Rows of its accuracy part; None where it has none."""
        try:
            return self.store.ticks(self.cell)
        except FileNotFoundError:
            return None

    def times(self) -> pl.DataFrame | None:
        """Rows of its timing part; None where it has none."""
        return self.store.times(self.cell)


def cases_of(store: Store) -> list[Case]:
    """All cells of a results folder in the manifest's order, those that failed or were not run among them."""
    scenarios: dict[str, Scenario] = {}
    for cell in store.manifest.cells:
        if cell.scenario not in scenarios:
            scenarios[cell.scenario] = get_scenario(cell.scenario)
    return [Case(cell, scenarios[cell.scenario], store.outcome(cell), store) for cell in store.manifest.cells]
