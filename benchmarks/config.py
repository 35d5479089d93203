"""What a sweep runs."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from ..formulations import available_formulations, get_formulation
from ..solvers import available_solvers, get_solver
from .scenarios import available_scenarios, get_scenario

if TYPE_CHECKING:
    from pathlib import Path

Names = Annotated[tuple[str, ...], Field(min_length=1)]


class ConfigError(ValueError):
    """A sweep's configuration can't be used; the message names the key, what was expected and what was got."""


class SweepConfig(BaseModel):
    """A sweep: every scenario x formulation x solver is a cell.

    Names take options in brackets: ``"clarabel(tolerance=1e-8)"``.

    Parameters
    ----------
    scenarios, formulations, solvers : tuple of str
        At least one each.
    repeats : int
        Timed runs of each cell.
    warm_up : int
        Ticks run and thrown away before each timed run.
    seed : int
        Of the order of the runs.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    scenarios: Names = ("semicircle",)
    formulations: Names = ("cartesian-error", "joint-space")
    solvers: Names = ("active-set", "thesis-active-set", "clarabel", "piqp")
    repeats: Annotated[int, Field(ge=1)] = 3
    warm_up: Annotated[int, Field(ge=0)] = 200
    seed: Annotated[int, Field(ge=0)] = 0

    @field_validator("scenarios", "formulations", "solvers")
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
    def _solvers_exist(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            _checked_solver(name)
        return names


def _checked_solver(name: str) -> None:
    try:
        get_solver(name)
    except TypeError as error:
        # pydantic reports ValueErrors only; an unknown option is a TypeError as it is for any Python call.
        raise ValueError(str(error)) from error


CHOICES: Final = {
    "scenarios": available_scenarios,
    "formulations": available_formulations,
    "solvers": available_solvers,
}


def load_config(path: Path | None = None) -> SweepConfig:
    """Read a sweep from a TOML file; without one, the shipped default.

    Raises
    ------
    ConfigError
        Naming the file, the key, and the choices.
    """
    if path is None:
        return SweepConfig()
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{path}: expected a readable TOML file: {error}") from error
    return make_config(given, str(path))


def make_config(given: dict[str, object], source: str = "sweep") -> SweepConfig:
    """Check a sweep given as a mapping; errors name `source`, the key and the choices."""
    try:
        return SweepConfig.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            known = ", ".join(SweepConfig.model_fields)
            raise ConfigError(f"{source}: expected keys among {known}, got {key!r}") from error
        raise ConfigError(f"{source}: {key}: {first['msg'].removeprefix('Value error, ')}") from error
