"""The scenarios, by name."""

from __future__ import annotations

from typing import Final

from ...solvers.plugins import Registry
from .base import Scenario
from .drilling import drilling
from .limits import infeasible, limit_corner, start_outside_limits
from .random_states import random_states
from .semicircle import semicircle
from .singularities import singular_elbow, singular_shoulder, singular_wrist, workspace_boundary
from .tool_modes import drill_line, mode_switch, rcm_pivot

_REGISTRY: Final = Registry(
    "scenario",
    "kinqp.scenarios",
    Scenario,
    {
        "semicircle": semicircle,
        "singular-elbow": singular_elbow,
        "singular-wrist": singular_wrist,
        "singular-shoulder": singular_shoulder,
        "workspace-boundary": workspace_boundary,
        "drill-line": drill_line,
        "rcm-pivot": rcm_pivot,
        "drilling": drilling,
        "limit-corner": limit_corner,
        "mode-switch": mode_switch,
        "random-states": random_states,
        "start-outside-limits": start_outside_limits,
        "infeasible": infeasible,
    },
)


def available_scenarios() -> tuple[str, ...]:
    """Names of the scenarios: the library's own and those of installed packages, sorted."""
    return _REGISTRY.names()


def is_builtin(name: str) -> bool:
    """Whether a scenario is one of the library's own."""
    return name in _REGISTRY.builtin


def get_scenario(scenario: str | Scenario) -> Scenario:
    """Find a scenario by registered name or ``module:Name``; an instance is returned as it is.

    Raises
    ------
    PluginError
        When there is none of that name.
    """
    return _REGISTRY.get(scenario)
