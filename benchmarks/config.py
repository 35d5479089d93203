"""What a sweep runs."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator

from .. import configs
from ..formulations import available_formulations, get_formulation
from ..solvers import available_solvers, get_solver
from ..solvers.plugins import PluginError
from .cells import STARTS, Cell
from .scenarios import available_scenarios, get_scenario

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pydantic_core import ErrorDetails

Names = Annotated[tuple[str, ...], Field(min_length=1)]
#: In a list of names: all there are.
ALL: Final = "all"


class ConfigError(ValueError):
    """A sweep's configuration can't be used; the message names line and key, what was expected and what was got."""


class Product(BaseModel):
    """Every scenario x formulation x solver, each with every start that the solver has.

    Names take options in brackets: ``"clarabel(tolerance=1e-8)"``; "all" stands for all there are.

    Parameters
    ----------
    scenarios, formulations, solvers : tuple of str
        At least one each.
    starts : tuple of {"cold", "active-set", "solution"}
        How the solvers start. Starts that a solver does not have are left out, and named in the manifest.
    skip_missing : bool
        Whether solvers that are not installed are left out, and named in the manifest, instead of being an error.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    skip_missing: bool = False
    scenarios: Names = ("semicircle",)
    formulations: Names = ("cartesian-error", "joint-space")
    solvers: Names = ("active-set", "thesis-active-set", "clarabel", "piqp")
    starts: Names = ("cold",)

    @field_validator("scenarios", "formulations", "solvers", mode="after")
    @classmethod
    def _expanded(cls, names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        if ALL not in names:
            return names
        # What is named beside "all" is meant beside it: a solver with options, a module's own.
        everything = CHOICES[str(info.field_name)]()
        return (*everything, *(name for name in names if name != ALL and name not in everything))

    @field_validator("scenarios", "formulations", "solvers", "starts")
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

    @field_validator("formulations")
    @classmethod
    def _formulations_exist(cls, names: tuple[str, ...]) -> tuple[str, ...]:
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
        """Its cells in the order of its lists."""
        return tuple(Cell(*names) for names in self._combined() if names[3] in self._starts(names[2]))

    def skipped(self) -> dict[str, str]:
        """What is left out of the product, as "solver from last start", and why."""
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
    "formulations": available_formulations,
    "solvers": lambda: available_solvers(bridges=True),
}


def load_config(path: Path | None = None) -> SweepConfig:
    """Read a sweep from a TOML file; without one, the shipped default.

    Where there is no such file, ``configs/full.toml`` and the like are those that came with the library.

    Raises
    ------
    ConfigError
        Naming the file, the line, the key, and the choices.
    """
    if path is None:
        return SweepConfig()
    try:
        text = _shipped(path) or path.read_text(encoding="utf-8")
        given = tomllib.loads(text)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: expected a readable TOML file: {error}") from error
    return make_config(given, str(path), text)


def _shipped(path: Path) -> str | None:
    shipped = files(configs).joinpath(path.name)
    if path.exists() or path.parent.name != "configs" or not shipped.is_file():
        return None
    return shipped.read_text(encoding="utf-8")


def make_config(given: dict[str, object], source: str = "sweep", text: str = "") -> SweepConfig:
    """Check a sweep given as a mapping; errors name `source`, the line of its `text`, the key and the choices."""
    try:
        config = SweepConfig.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        line = _line(text, first["loc"], first["msg"])
        raise ConfigError(f"{source}{line}: {_message(first)}") from error
    for index, product in enumerate(config.products()):
        if not product.cells():
            loc = ("starts",) if index == 0 else ("more", index - 1, "starts")
            choices = "; ".join(f"{solver}: {', '.join(starts_of(solver))}" for solver in product.solvers)
            raise ConfigError(
                f"{source}{_line(text, loc, '')}: {_key(loc)}: expected starts that some solver has ({choices}), got "
                f"{', '.join(product.starts)}: not one cell is left"
            )
    return config


def _message(error: ErrorDetails) -> str:
    loc = error["loc"]
    model = Product if "more" in loc else SweepConfig
    if error["type"] == "extra_forbidden":
        return f"expected keys among {', '.join(model.model_fields)}, got {_key(loc)!r}"
    message = error["msg"].removeprefix("Value error, ")
    if error["type"] == "too_short" and str(loc[-1]) in CHOICES:
        message = f"expected at least one of {', '.join(CHOICES[str(loc[-1])]())}, or {ALL!r}, got an empty list"
    elif error["type"] == "too_short":
        message = f"expected at least one of {', '.join(STARTS)}, got an empty list"
    return f"{_key(loc)}: {message}"


def _key(loc: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in loc)


def _line(text: str, loc: tuple[int | str, ...], message: str) -> str:
    """Say on which line of a TOML text a key, or the name in its list that a message is about, stands."""
    lines = text.splitlines()
    key = next((part for part in reversed(loc) if isinstance(part, str) and part != "more"), "more")
    table = -1  # before the first [[more]]
    wanted = loc[1] if loc[:1] == ("more",) and len(loc) > 1 else -1
    start = None
    for number, line in enumerate(lines):
        if re.match(r"\s*\[\[\s*more\s*\]\]", line):
            table += 1
        if table == wanted and re.match(rf"""\s*["']?{re.escape(key)}["']?\s*=""", line):
            start = number
            break
    if start is None:
        return ""
    found = start
    for number in range(start, len(lines)):
        if number > start and re.match(r"\s*(\[\[|[\w\"'-]+\s*=)", lines[number]):
            break
        for one, other in re.findall(r'"([^"]*)"|\'([^\']*)\'', lines[number].partition("#")[0]):
            name = one or other
            # Named as what was got; choices stand in messages without quotes.
            if f"{name.partition('(')[0]!r}" in message or f"twice: {name}" in message:
                found = number
    return f", line {found + 1}"
