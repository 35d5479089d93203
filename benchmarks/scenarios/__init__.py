"""Scenarios: what is guided, how, from where; one file each."""

from .base import Phase, Scenario, ScenarioError, States
from .registry import available_scenarios, get_scenario, is_builtin
from .semicircle import semicircle

__all__ = [
    "Phase",
    "Scenario",
    "ScenarioError",
    "States",
    "available_scenarios",
    "get_scenario",
    "is_builtin",
    "semicircle",
]
