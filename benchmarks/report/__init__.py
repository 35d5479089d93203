"""The report: one page that works offline, and figures fit for a paper."""

from ..errors import ReportError
from .columns import COLUMNS, Column
from .downsample import distribution, extremes
from .paper import Selection
from .series import CLOCKS
from .write import Report, write_report

__all__ = [
    "CLOCKS",
    "COLUMNS",
    "Column",
    "Report",
    "ReportError",
    "Selection",
    "distribution",
    "extremes",
    "write_report",
]
