"""Metrics: a cell's two frames and its scenario summed up in one flat record, and records compared."""

from .against import AgainstHand
from .behaviour import AGREEMENT, Answers, Errors, Iterations, Motion
from .intervals import Estimate
from .motion import CHATTER_SHARE, JUMP_SHARE, ON_LIMIT
from .possible import Possible
from .ratios import SAME_PROBLEMS, RecordsError, geometric_means, performance_profile
from .record import CellRecord, cell_record
from .requirements import REQUIREMENTS, Requirement
from .scorecard import records, scorecard, scorecard_of
from .ticks import FrameError, Ticks
from .timing import CellTimes, TimeSpread

__all__ = [
    "AGREEMENT",
    "CHATTER_SHARE",
    "JUMP_SHARE",
    "ON_LIMIT",
    "REQUIREMENTS",
    "SAME_PROBLEMS",
    "AgainstHand",
    "Answers",
    "CellRecord",
    "CellTimes",
    "Errors",
    "Estimate",
    "FrameError",
    "Iterations",
    "Motion",
    "Possible",
    "RecordsError",
    "Requirement",
    "Ticks",
    "TimeSpread",
    "cell_record",
    "geometric_means",
    "performance_profile",
    "records",
    "scorecard",
    "scorecard_of",
]
