"""Sweeps that are read, compared and drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from kinqp.benchmarks import Store, sweep
from tests.benchmarks.report.candidate import BEHAVIOUR

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

HERE = "tests.benchmarks.tiny:"
CANDIDATE = "tests.benchmarks.report.candidate:Candidate"
CONFIG = {
    "scenarios": [HERE + "tiny", HERE + "two_phases", HERE + "three_states"],
    "formulations": ["cartesian-error", "joint-space"],
    "solvers": ["active-set", "clarabel", HERE + "Lying"],
    "starts": ["cold", "active-set"],
    "baselines": ["gradient-projection", "task-priority"],
    # A crash takes a worker process with it, and starting another takes longer than all of these cells.
    "more": [{"scenarios": [HERE + "tiny"], "formulations": ["joint-space"], "solvers": [HERE + "Crashing"]}],
    "repeats": 5,
    "timing_ticks": 10,
    "timing_window": 5,
}
SMALL = {
    "scenarios": [HERE + "tiny"],
    "formulations": ["cartesian-error"],
    "solvers": ["active-set", CANDIDATE],
    "repeats": 8,
    "timing_ticks": 10,
    "timing_window": 10,
}


@pytest.fixture(scope="session")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A sweep with all that a report must show: a liar, a crash, a change of mode, states one by one."""
    return sweep(CONFIG, tmp_path_factory.mktemp("swept"), workers=1)


@pytest.fixture(scope="session")
def candidate(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Store]:
    """Sweep the candidate with a behaviour: a function of its name."""
    made: dict[str, Store] = {}

    def run(behaviour: str) -> Store:
        if behaviour not in made:
            out: Path = tmp_path_factory.mktemp(behaviour or "honest")
            with pytest.MonkeyPatch.context() as patch:
                patch.setenv(BEHAVIOUR, behaviour)
                made[behaviour] = sweep(SMALL, out, workers=1)
        return made[behaviour]

    return run
