"""A Dask cluster: a real scheduler, two workers, one of them killed half-way."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from kinqp.benchmarks import ClusterError, sweep
from tests.benchmarks.sweeps import TINY, same_accuracy

if TYPE_CHECKING:
    from collections.abc import Iterator

# What Dask warns of is its own business.
pytestmark = pytest.mark.filterwarnings("default")
ROOT = Path(__file__).parents[2]


def start(*arguments: str) -> subprocess.Popen[bytes]:
    # No dashboard, no nanny: what is killed is to stay dead. The tests' scenario is found from the repository's root.
    return subprocess.Popen(
        [sys.executable, "-m", *arguments],
        env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    import json

    file = tmp_path / "scheduler.json"
    where = ("--scheduler-file", str(file))
    common = (*where, "--no-dashboard")
    started = [start("distributed.cli.dask_scheduler", *common, "--port", "0", "--host", "127.0.0.1")]
    for _ in range(2):
        options = ("--no-nanny", "--nthreads", "1", "--local-directory", str(tmp_path))
        started.append(start("distributed.cli.dask_worker", *common, *options))
    try:
        deadline = time.monotonic() + 60.0
        address = ""
        while not address and time.monotonic() < deadline:
            with contextlib.suppress(OSError, ValueError):
                address = json.loads(file.read_text())["address"]
            time.sleep(0.05)
        yield address, started
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_a_cluster_gives_the_same_and_a_lost_worker_costs_nothing(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path
) -> None:
    address, (_scheduler, *workers) = cluster
    killed: list[int] = []

    def kill_one(done: int, _total: int, _what: str) -> None:
        if done == 2 and not killed:
            workers[0].send_signal(signal.SIGKILL)
            killed.append(workers[0].wait())

    store = sweep(TINY, tmp_path / "cluster", scheduler=address, on_progress=kill_one)
    assert killed == [-signal.SIGKILL]
    assert workers[1].poll() is None
    assert store.failed() == {}
    assert len(store.cells()) == 6
    same_accuracy(store, sweep(TINY, tmp_path / "serial", workers=1))
    assert all(store.times(cell) is not None for cell in store.cells())


def test_no_scheduler_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ClusterError, match=r"expected a Dask scheduler at tcp://127\.0\.0\.1:9, got"):
        sweep(TINY, tmp_path, scheduler="tcp://127.0.0.1:9")


def test_a_scheduler_that_dies_is_one_sentence_and_what_came_back_is_kept(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path
) -> None:
    address, (scheduler, *_workers) = cluster

    def kill(done: int, _total: int, _what: str) -> None:
        if done == 1:
            scheduler.kill()

    with pytest.raises(ClusterError, match=r"--scheduler: expected the Dask scheduler at .* it is gone .* --resume"):
        sweep(TINY, tmp_path, scheduler=address, on_progress=kill)
    assert len(list((tmp_path / "ticks").iterdir())) >= 1
