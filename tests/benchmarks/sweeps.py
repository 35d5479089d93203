"""A sweep of a few cells, and what two runs of it must agree on."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kinqp.benchmarks import Store

HERE = "tests.benchmarks.tiny:"
TINY = {
    "scenarios": [HERE + "tiny"],
    "formulations": ["cartesian-error", "joint-space"],
    "solvers": ["active-set", "clarabel(tolerance=1e-8)"],
    "starts": ["cold", "active-set"],
    "repeats": 2,
    "timing_ticks": 4,
    "timing_window": 2,
}
CELLS = 6
# What two runs can't have in common.
CLOCKS = ("setup_time", "update_time", "solve_time")


def same_accuracy(a: Store, b: Store) -> None:
    assert a.cells() == b.cells()
    for cell in a.cells():
        assert a.ticks(cell).drop(CLOCKS).equals(b.ticks(cell).drop(CLOCKS)), cell
