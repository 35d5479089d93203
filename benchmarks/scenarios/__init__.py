"""Scenarios: what is guided, how, from where; one file each."""

from .base import Scenario
from .registry import available_scenarios, get_scenario
from .semicircle import semicircle

__all__ = ["Scenario", "available_scenarios", "get_scenario", "semicircle"]
