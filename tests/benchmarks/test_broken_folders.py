"""Results folders with broken files, and two sweeps in one: a sentence that says what to do, and doing it helps."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from kinqp.benchmarks import Store, StoreError, sweep, sweep_table
from kinqp.benchmarks.lock import sole_writer
from kinqp.benchmarks.report import write_report
from tests.benchmarks.sweeps import TINY

if TYPE_CHECKING:
    from collections.abc import Callable

QUICK = TINY | {"formulations": ["joint-space"], "solvers": ["active-set"], "starts": ["cold"]}
NESTED = "[" * 100_000


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    sweep(QUICK, folder, workers=1)
    return folder


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "results"))


def resume(folder: Path) -> object:
    return sweep(QUICK, folder, resume=True, workers=1)


def report(folder: Path) -> object:
    return write_report(Store(folder), figures=False)


def table(folder: Path) -> object:
    return sweep_table(Store(folder))


def cut_off(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


uses = pytest.mark.parametrize("use", [resume, report, table])

OUTCOMES = {
    "empty": "",
    "list": "[]",
    "number": "7",
    "no JSON": '{"accuracy": {"state": "do',
    "no text": b"\xff\xfe\x00",
    "another part": '{"speed": null}',
    "part of another kind": '{"accuracy": [1, 2]}',
    "another field": '{"accuracy": {"state": "done", "mood": "good"}}',
    "another state": '{"accuracy": {"state": "splendid"}}',
    "nested": NESTED,
}


def write(path: Path, content: str | bytes) -> None:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())


@uses
@pytest.mark.parametrize("content", OUTCOMES.values(), ids=OUTCOMES.keys())
def test_a_broken_end_of_a_cell(folder: Path, use: Callable[[Path], object], content: str | bytes) -> None:
    (path,) = (folder / "cells").iterdir()
    write(path, content)
    with pytest.raises(StoreError, match=r"cells/.*\.json: expected .*, got .*; delete it and continue .* --resume"):
        use(folder)


MANIFESTS = {
    "list": ("[]", "expected a JSON object, got a list"),
    "empty": ("", "expected JSON, got"),
    "another format": ('{"format": 1}', "expected format 2, got 1"),
    "no config": ('{"format": 2}', "expected the manifest of a sweep, got KeyError: 'config'"),
    "nested": (NESTED, "expected JSON, got"),
}


@uses
@pytest.mark.parametrize(("content", "message"), MANIFESTS.values(), ids=MANIFESTS.keys())
def test_a_broken_manifest(folder: Path, use: Callable[[Path], object], content: str, message: str) -> None:
    (folder / "manifest.json").write_text(content)
    with pytest.raises(StoreError, match=rf"manifest\.json: {message}"):
        use(folder)


@uses
@pytest.mark.parametrize(
    "change", [{"cells": {"a": 1}}, {"cells": [{"scenario": 1}]}, {"conditions": []}, {"skipped": 3}]
)
def test_a_manifest_with_something_else_in_it(folder: Path, use: Callable[[Path], object], change: object) -> None:
    path = folder / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(StoreError, match=r"manifest\.json: expected the manifest of a sweep, got .*--overwrite"):
        use(folder)


@uses
@pytest.mark.parametrize("kind", ["ticks", "times"])
def test_a_parquet_file_that_is_cut_off(folder: Path, use: Callable[[Path], object], kind: str) -> None:
    (path,) = (folder / kind).iterdir()
    shutil.rmtree(folder / "records", ignore_errors=True)
    cut_off(path)
    with pytest.raises(
        StoreError, match=rf"{kind}/.*: expected a whole Parquet file, got .*; delete it and continue .*"
    ):
        use(folder)


@pytest.mark.parametrize("kind", ["ticks", "times"])
def test_what_the_message_says_helps(folder: Path, kind: str) -> None:
    (path,) = (folder / kind).iterdir()
    path.unlink()
    resume(folder)
    assert path.exists()
    assert not Store(folder).failed()


def test_a_parquet_file_with_rubbish_inside(folder: Path) -> None:
    (path,) = (folder / "ticks").iterdir()
    content = path.read_bytes()
    path.write_bytes(content[:4] + bytes(len(content) - 8) + content[-4:])
    with pytest.raises(StoreError, match="expected a whole Parquet file, got"):
        report(folder)


def test_problems_that_are_cut_off_are_recorded_again(folder: Path) -> None:
    (problems,) = (folder / "problems").glob("*.npz")
    cut_off(problems)
    (times,) = (folder / "times").iterdir()
    times.unlink()
    problems.with_suffix(".begun").write_bytes(b"{\n")
    resume(folder)
    assert times.exists()
    assert not Store(folder).failed()


HOLD = "import sys, time; from pathlib import Path; from kinqp.benchmarks.lock import sole_writer\n"
HOLD += "with sole_writer(Path(sys.argv[1])): print('held', flush=True); time.sleep(60)"


def test_a_second_sweep_in_a_folder_is_told_of_the_first_and_takes_over_when_that_is_dead(folder: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        host = os.uname().nodename
        told = rf"no other process to write here, got process {other.pid} on {host}, running since \d{{4}}-\d\d-\d\dT"
        for options in ({"resume": True}, {"overwrite": True}):
            with pytest.raises(StoreError, match=told):
                sweep(QUICK, folder, workers=1, **options)
        assert len(Store(folder).cells()) == 1
        other.kill()
    with sole_writer(folder):
        pass


def test_a_folder_that_another_host_writes_to(folder: Path) -> None:
    path = folder / "running.lock"
    path.write_text(json.dumps({"pid": 12, "host": "elsewhere", "since": "2020-01-01T00:00:00+00:00"}))
    with pytest.raises(
        StoreError, match=r"got process 12 on elsewhere, running since 2020-.*; if that has ended, delete"
    ):
        resume(folder)
    path.unlink()
    with sole_writer(folder):
        pass


def test_two_writers_of_one_process(tmp_path: Path) -> None:
    with sole_writer(tmp_path), pytest.raises(StoreError, match=f"got process {os.getpid()} on"), sole_writer(tmp_path):
        pass
    with sole_writer(tmp_path):
        pass
