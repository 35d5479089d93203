"""What must hold of every command, checked on random and adversarial states: ``python -m kinqp.benchmarks.invariants``.

Judged without the library's own symbols: pinocchio's Jacobian, bounds in NumPy, a second solver's cost.
"""

from .blocks import Block, run_block
from .run import InvariantsError, read_rows, run
from .states import States, arm
from .table import to_markdown
from .tally import Row, Violation

__all__ = [
    "Block",
    "InvariantsError",
    "Row",
    "States",
    "Violation",
    "arm",
    "read_rows",
    "run",
    "run_block",
    "to_markdown",
]
