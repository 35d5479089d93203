"""Metrics: a cell's two frames and its scenario summed up in one flat record, and records compared."""

from .behaviour import AGREEMENT, Answers, Errors, Iterations, Motion
from .cell import CellMetrics, cell_metrics
from .motion import CHATTER_SHARE, JUMP_SHARE, ON_LIMIT
from .ratios import SAME_PROBLEMS, RecordsError, geometric_means, performance_profile
from .record import CellRecord, cell_record
from .requirements import REQUIREMENTS, Requirement
from .scorecard import scorecard_of
from .spread import Estimate, Spread
from .ticks import FrameError, Ticks
from .timing import CellTimes, TimeSpread

__all__ = [
    "AGREEMENT",
    "CHATTER_SHARE",
    "JUMP_SHARE",
    "ON_LIMIT",
    "REQUIREMENTS",
    "SAME_PROBLEMS",
    "Answers",
    "CellMetrics",
    "CellRecord",
    "CellTimes",
    "Errors",
    "Estimate",
    "FrameError",
    "Iterations",
    "Motion",
    "RecordsError",
    "Requirement",
    "Spread",
    "Ticks",
    "TimeSpread",
    "cell_metrics",
    "cell_record",
    "geometric_means",
    "performance_profile",
    "scorecard_of",
]
