"""The scenarios, by name."""

from __future__ import annotations

from typing import Final

from ...solvers.plugins import Registry
from .base import Scenario
from .semicircle import semicircle

_REGISTRY: Final = Registry(
    "scenario",
    "kinqp.scenarios",
    Scenario,
    {"semicircle": semicircle},
)


def available_scenarios() -> tuple[str, ...]:
    """Names of the scenarios: the library's own and those of installed packages, sorted."""
    return _REGISTRY.names()


def get_scenario(scenario: str | Scenario) -> Scenario:
    """Find a scenario by registered name or ``module:Name``; an instance is returned as it is.

    Raises
    ------
    PluginError
        When there is none of that name.
    """
    return _REGISTRY.make(scenario) if isinstance(scenario, str) else scenario
