"""What a sweep runs."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from ..baselines import available_baselines, get_baseline
from ..formulations import available_formulations, get_formulation
from ..solvers import available_solvers, get_solver
from ..solvers.plugins import PluginError
from .cells import STARTS, Cell
from .scenarios import available_scenarios, get_scenario

if TYPE_CHECKING:
    from collections.abc import Callable

Names = Annotated[tuple[str, ...], Field(min_length=1)]
#: In a list of names: all there are.
ALL: Final = "all"


class Product(BaseModel):
    """Every scenario x formulation x solver, each with every start that the solver has; and scenario x baseline.

    Names take options in brackets: ``"clarabel(tolerance=1e-8)"``; "all" stands for all there are.

    Parameters
    ----------
    scenarios, solvers : tuple of str
        At least one each.
    baselines : tuple of str
        Closed forms to compare with, which have no solver and no start; none unless named.
    formulations : tuple of str
        At least one; none where there are baselines.
    starts : tuple of {"cold", "active-set", "solution"}
        How the solvers start. Starts that a solver does not have are left out, and named in the manifest.
    skip_missing : bool
        Whether solvers that are not installed are left out, and named in the manifest, instead of being an error.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    skip_missing: bool = False
    scenarios: Names = ("semicircle",)
    # Before the formulations, of which there may be none where there are baselines.
    baselines: tuple[str, ...] = ()
    formulations: tuple[str, ...] = ("cartesian-error", "joint-space")
    solvers: Names = ("active-set", "thesis-active-set", "clarabel", "piqp")
    starts: Names = ("cold",)

    @field_validator("scenarios", "baselines", "formulations", "solvers", mode="after")
    @classmethod
    def _expanded(cls, names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        if ALL not in names:
            return names
        # What is named beside "all" is meant beside it: a solver with options, a module's own.
        everything = CHOICES[str(info.field_name)]()
        return (*everything, *(name for name in names if name != ALL and name not in everything))

    @field_validator("scenarios", "baselines", "formulations", "solvers", "starts")
    @classmethod
    def _each_once(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"expected each name once, got twice: {', '.join(twice)}")
        return names

    @field_validator("scenarios")
    @classmethod
    def _scenarios_exist(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            get_scenario(name)
        return names

    @field_validator("baselines")
    @classmethod
    def _baselines_exist(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            try:
                get_baseline(name)
            except TypeError as error:  # an unknown option; see `starts_of`
                raise ValueError(str(error)) from error
        return names

    @field_validator("formulations")
    @classmethod
    def _formulations_exist(cls, names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        if not names and not info.data.get("baselines"):
            choices = ", ".join(available_formulations())
            raise ValueError(f"expected at least one of {choices}, or {ALL!r}, got an empty list and no baselines")
        for name in names:
            get_formulation(name)
        return names

    @field_validator("solvers")
    @classmethod
    def _solvers_exist(cls, names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        for name in names:
            if not (info.data.get("skip_missing") and missing(name)):
                starts_of(name)
        return names

    @field_validator("starts")
    @classmethod
    def _starts_exist(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in STARTS:
                raise ValueError(f"expected starts among {', '.join(STARTS)}, got {name!r}")
        return names

    def cells(self) -> tuple[Cell, ...]:
        """Its cells in the order of its lists, baselines last."""
        solved = [Cell(*names) for names in self._combined() if names[3] in self._starts(names[2])]
        closed = [Cell.of_baseline(scenario, name) for scenario in self.scenarios for name in self.baselines]
        return (*solved, *closed)

    def skipped(self) -> dict[str, str]:
        """What is left out of the product, as "solver from last start", and why."""
        if not self.formulations:
            return {}
        without = {solver: why for solver in self.solvers if (why := missing(solver))}
        return without | {
            f"{solver} from last {start}": f"{solver} starts {', '.join(starts_of(solver))} only"
            for solver in self.solvers
            for start in self.starts
            if solver not in without and start not in starts_of(solver)
        }

    def _starts(self, solver: str) -> tuple[str, ...]:
        return () if missing(solver) else starts_of(solver)

    def _combined(self) -> list[tuple[str, str, str, str]]:
        return [
            (scenario, formulation, solver, start)
            for scenario in self.scenarios
            for formulation in self.formulations
            for solver in self.solvers
            for start in self.starts
        ]


class SweepConfig(Product):
    """A sweep: a product of names, further products, and how they are measured.

    Parameters
    ----------
    more : tuple of Product
        Further products, ``[[more]]`` in TOML; a cell that is in several is run once.
    repeats : int
        Timed visits of each cell.
    timing_ticks : int
        How many of a block's problems are timed at most, in windows of `timing_window` consecutive ones spread over
        the run.
    timing_window : int
        Ticks in a row; each window begins with one more, which is a full set-up.
    timing_budget : float
        Time for the timed solves of one cell, over all repeats [s]: slower solvers get fewer windows.
    sampled : tuple of str
        Solvers too slow for closed loops of their own: they are asked `samples` of the reference's states instead.
    samples : int
        How many.
    cell_timeout : float
        A solver that takes longer for its run or for one timed visit is stopped, and its cell has failed [s].
    seed : int
        Of the order of the visits and the choice of windows.
    """

    more: tuple[Product, ...] = ()
    repeats: Annotated[int, Field(ge=1)] = 20
    timing_ticks: Annotated[int, Field(ge=1)] = 1000
    timing_window: Annotated[int, Field(ge=1)] = 20
    timing_budget: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 4.0
    sampled: tuple[str, ...] = ()
    samples: Annotated[int, Field(ge=1)] = 200
    cell_timeout: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = 120.0
    seed: Annotated[int, Field(ge=0)] = 0

    @field_validator("sampled")
    @classmethod
    def _sampled_exist(cls, names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        for name in names:
            if not (info.data.get("skip_missing") and missing(name)):
                starts_of(name)
        return names

    def products(self) -> tuple[Product, ...]:
        """All products."""
        return (self, *self.more)


def cells_of(config: SweepConfig) -> tuple[Cell, ...]:
    """All cells of a sweep, each once: block by block, in the order in which blocks are first named."""
    blocks: dict[object, dict[Cell, None]] = {}
    for product in config.products():
        for cell in product.cells():
            blocks.setdefault(cell.block, {})[cell] = None
    return tuple(cell for cells in blocks.values() for cell in cells)


def skipped_of(config: SweepConfig) -> dict[str, str]:
    """What the products leave out, and why; see `Product.skipped`."""
    return {what: why for product in config.products() for what, why in product.skipped().items()}


@cache
def starts_of(solver: str) -> tuple[str, ...]:
    """Return the starts that a solver has.

    Raises
    ------
    ValueError
        When there is no such solver, or its options are wrong.
    """
    try:
        return ("cold", *get_solver(solver).starts)
    except TypeError as error:
        # pydantic reports ValueErrors only; an unknown option is a TypeError as it is for any Python call.
        raise ValueError(str(error)) from error


@cache
def missing(solver: str) -> str:
    """Say why there is no such solver here; empty where there is one, whatever its options."""
    try:
        get_solver(solver)
    except PluginError as error:
        return str(error)
    except (TypeError, ValueError):
        return ""
    return ""


CHOICES: Final[dict[str, Callable[[], tuple[str, ...]]]] = {
    "scenarios": available_scenarios,
    "baselines": available_baselines,
    "formulations": available_formulations,
    "solvers": lambda: available_solvers(bridges=True),
}
