"""Benchmarks: scenarios, sweeps over formulations and solvers, what is stored of them, and the table."""

from .cells import STARTS, Block, Cell
from .cluster import ClusterError
from .compare import Comparison, compare
from .conditions import conditions
from .config import Product, SweepConfig, cells_of
from .errors import CompareError, ReportError
from .loading import ConfigError, load_config, make_config
from .manifest import Manifest
from .metrics import ON_LIMIT, REQUIREMENTS, cell_record, geometric_means, performance_profile, records, scorecard
from .reading import StoreError
from .scenarios import Phase, Scenario, ScenarioError, States, available_scenarios, get_scenario
from .store import Outcome, Part, Store
from .summary import CellSummary, Spread, cell_summary
from .sweep import sweep
from .table import TABLE_WIDTH, sweep_table

__all__ = [
    "ON_LIMIT",
    "REQUIREMENTS",
    "STARTS",
    "TABLE_WIDTH",
    "Block",
    "Cell",
    "CellSummary",
    "ClusterError",
    "CompareError",
    "Comparison",
    "ConfigError",
    "Manifest",
    "Outcome",
    "Part",
    "Phase",
    "Product",
    "ReportError",
    "Scenario",
    "ScenarioError",
    "Spread",
    "States",
    "Store",
    "StoreError",
    "SweepConfig",
    "available_scenarios",
    "cell_record",
    "cell_summary",
    "cells_of",
    "compare",
    "conditions",
    "geometric_means",
    "get_scenario",
    "load_config",
    "make_config",
    "performance_profile",
    "records",
    "scorecard",
    "sweep",
    "sweep_table",
]
