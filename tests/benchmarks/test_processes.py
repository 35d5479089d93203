"""Worker processes: what they run in."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import pytest

from kinqp.benchmarks import cells_of, make_config
from kinqp.benchmarks.processes import Worker
from kinqp.benchmarks.study import StudyError, run_study, study_settings
from tests.benchmarks.sweeps import HERE, TINY
from tests.benchmarks.tiny import TOLD

if TYPE_CHECKING:
    from pathlib import Path

# Spelled out once more, on purpose: what these tests are about is that the names are right.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@pytest.fixture(autouse=True)
def many_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ask for many threads, as a user's shell may."""
    for name in THREADS:
        monkeypatch.setenv(name, "4")


def test_a_worker_has_one_thread_whatever_the_shell_asks_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOLD, str(tmp_path / "told.json"))
    config = make_config(TINY | {"formulations": ["joint-space"], "solvers": [HERE + "Telling"], "starts": ["cold"]})
    (cell,) = cells_of(config)
    worker = Worker()
    try:
        ran = worker.run(cell, config)
    finally:
        worker.stop()
    assert ran.part.state == "done", ran.part
    told = json.loads((tmp_path / "told.json").read_text(encoding="utf-8"))
    assert {name: told["environment"].get(name) for name in THREADS} == dict.fromkeys(THREADS, "1")
    assert told["threads"] == 1


def test_a_worker_of_a_study_has_one_thread_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\nenv > '{tmp_path}/told'\n", encoding="utf-8")
    python.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(python))
    settings = study_settings(operators=1, trials=1, time_limit=1.0)
    with pytest.raises(StudyError):
        run_study(settings, tmp_path / "study", processes=1)
    told = (tmp_path / "told").read_text(encoding="utf-8").splitlines()
    assert {f"{name}=1" for name in THREADS} <= set(told)
