"""Benchmarks: scenarios, sweeps over formulations and solvers, what is stored of them, and the table."""

from .conditions import conditions
from .config import ConfigError, SweepConfig, load_config, make_config
from .metrics import ON_LIMIT, CellMetrics, Spread, cell_metrics
from .scenarios import Phase, Scenario, ScenarioError, States, available_scenarios, get_scenario
from .store import Cell, Store, StoreError, cells_of
from .sweep import sweep, timed_run
from .table import TABLE_WIDTH, sweep_table

__all__ = [
    "ON_LIMIT",
    "TABLE_WIDTH",
    "Cell",
    "CellMetrics",
    "ConfigError",
    "Phase",
    "Scenario",
    "ScenarioError",
    "Spread",
    "States",
    "Store",
    "StoreError",
    "SweepConfig",
    "available_scenarios",
    "cell_metrics",
    "cells_of",
    "conditions",
    "get_scenario",
    "load_config",
    "make_config",
    "sweep",
    "sweep_table",
    "timed_run",
]
