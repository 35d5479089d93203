"""`kinqp report` and `kinqp compare`, as people and CIs call them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

from kinqp.benchmarks import sweep

ROOT = Path(__file__).parents[2]
CONFIG = {
    "scenarios": ["tests.benchmarks.tiny:tiny"],
    "formulations": ["cartesian-error"],
    "solvers": ["active-set"],
    "repeats": 5,
    "timing_ticks": 5,
    "timing_window": 5,
}


def kinqp(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "kinqp.cli", *map(str, arguments)],
        capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)}, timeout=120, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sweep(CONFIG, tmp_path_factory.mktemp("results"), workers=1).folder


@pytest.fixture
def worse(results: Path, tmp_path: Path) -> Path:
    """The same sweep with one more iteration at one tick."""
    import shutil

    folder = tmp_path / "worse"
    shutil.copytree(results, folder)
    (path,) = (folder / "ticks").iterdir()
    frame = pl.read_parquet(path)
    more = frame["iterations"].to_list()
    more[7] += 1
    frame.with_columns(pl.Series("iterations", more)).write_parquet(path)
    return folder


def test_report_says_what_it_wrote_and_what_next(results: Path) -> None:
    done = kinqp("report", results, "--no-figures")
    assert done.returncode == 0, done.stderr
    page = results / "report" / "index.html"
    assert page.exists()
    assert f"Wrote {page} (1 cells," in done.stdout
    assert "Next: open" in done.stdout
    assert not (results / "report" / "figures").exists()


def test_what_is_not_there_ends_in_one_sentence(results: Path, tmp_path: Path) -> None:
    for arguments in (
        ("report", tmp_path), ("report", results, "--solver", "magic"), ("compare", results, tmp_path),
        ("compare", results, results, "--tolerance", "-1"),
    ):  # fmt: skip
        done = kinqp(*arguments)
        assert done.returncode == 2, arguments
        assert done.stderr.startswith("kinqp: "), done.stderr
        assert "Traceback" not in done.stderr


def test_compare_exits_by_what_it_finds(results: Path, worse: Path) -> None:
    same = kinqp("compare", results, results)
    assert same.returncode == 0, same.stdout + same.stderr
    assert "1 cells compared, 1 with times: 0 worse, 0 changed, 0 better." in same.stdout
    assert "No regression." in same.stdout
    done = kinqp("compare", results, worse)
    assert done.returncode == 1
    assert "iterations" in done.stdout
    assert "more at 1 ticks" in done.stdout.replace("\n", " ")
    assert kinqp("compare", worse, results).returncode == 0


def test_compare_prints_json_for_machines(results: Path, worse: Path) -> None:
    done = kinqp("compare", results, worse, "--json", "--no-times")
    found = json.loads(done.stdout)
    assert done.returncode == 1
    assert found["regressed"] is True
    assert [(one["measure"], one["verdict"]) for one in found["findings"]] == [("iterations", "worse")]
    assert found["findings"][0]["b"] == found["findings"][0]["a"] + 1
    assert found["times_compared"] is False
