"""The command, as people type it."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

ROOT = Path(__file__).parents[2]
TINY = """
scenarios = ["tests.benchmarks.tiny:tiny"]
solvers = ["thesis-active-set", "piqp"]
repeats = 2
timing_ticks = 4
timing_window = 2
"""


def command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "kinqp.cli", *map(str, arguments)]


def environment() -> dict[str, str]:
    # The tests' own scenario is found from the repository's root.
    return os.environ | {"PYTHONPATH": str(ROOT)}


def kinqp(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*arguments), capture_output=True, text=True, env=environment(), timeout=120, check=False
    )


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "sweep.toml"
    path.write_text(TINY)
    return path


def test_list_names_everything() -> None:
    done = kinqp("list")
    assert done.returncode == 0
    for name in (
        "lbr_med14", "lbr_med7", "ur5e", "davinci5", "fix-orientation", "rcm", "cartesian-error", "joint-space",
        "thesis-active-set", "clarabel", "piqp", "semicircle", "task-priority", "saturation-null-space",
    ):  # fmt: skip
        assert name in done.stdout.split(), name


def test_sweep_prints_the_table_and_says_where_it_wrote(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = kinqp("sweep", config, "--out", out)
    assert done.returncode == 0, done.stderr
    for text in (
        "cartesian-error",
        "joint-space",
        "thesis-active-set",
        "piqp",
        "time us",
        "p99",
        "fixed",
        "cpu",
        "Next:",
    ):
        assert text in done.stdout
    assert "…" not in done.stdout, "no figure is cut"
    assert str(out) in done.stdout.replace("\n", "")
    assert len(list((out / "ticks").glob("*.parquet"))) == len(list((out / "times").glob("*.parquet"))) == 4
    again = kinqp("sweep", config, "--out", out)
    assert again.returncode == 2
    assert "--resume" in again.stderr
    assert "Traceback" not in again.stderr
    assert kinqp("sweep", config, "--out", out, "--resume", "--workers", "1").returncode == 0
    nobody = kinqp("sweep", config, "--out", tmp_path / "cluster", "--scheduler", "nowhere")
    assert nobody.returncode == 2
    assert "expected an address such as tcp://host:8786, got 'nowhere'" in nobody.stderr.replace("\n", " ")
    assert "Traceback" not in nobody.stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('solvers = ["clarable"]', "did you mean 'clarabel'"),
        ("solver = 1", "got 'solver'"),
        ("repeats = 0", "repeats"),
    ],
)
def test_a_mistake_is_one_sentence_and_nothing_is_written(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    done = kinqp("sweep", path, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_words_of_a_file_are_neither_markup_nor_commands_of_the_terminal(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text('<robot name="a"><link name="[/red]\u009b31m[bold]\u202e"/><link name="b"/></robot>')
    done = kinqp("describe", "--robot", path, "--formulation", "joint-space", "--mode", "line:z")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "[/red] 31m[bold]" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("command", [("report",), ("worst-case", "--replay"), ("certify", "--replay"), ("sweep",)])
def test_a_file_of_brackets_is_one_sentence(tmp_path: Path, command: tuple[str, ...]) -> None:
    brackets = "[" * 100_000
    (tmp_path / "manifest.json").write_text(brackets)
    (tmp_path / "sweep.toml").write_text("a = " + brackets)
    given = {"report": tmp_path, "sweep": tmp_path / "sweep.toml"}.get(command[0], tmp_path / "manifest.json")
    done = kinqp(*command, given)
    assert done.returncode == 2, done.stderr[-500:]
    assert "Traceback" not in done.stderr


def test_ctrl_c_keeps_the_cells_done(tmp_path: Path) -> None:
    path, out = tmp_path / "long.toml", tmp_path / "out"
    path.write_text(TINY.replace("repeats = 2", "repeats = 100000"))
    process = begin(path, out)
    wait_for(lambda: len(list(out.glob("ticks/*.parquet"))) == 4, process)
    process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stderr
    assert "Interrupted" in stdout
    assert "--resume" in stdout
    assert "Traceback" not in stderr
    assert len(list(out.glob("ticks/*.parquet"))) == 4


@pytest.mark.long
def test_kill_minus_nine_three_times_loses_at_most_what_was_being_run(tmp_path: Path) -> None:
    path, out = tmp_path / "sweep.toml", tmp_path / "out"
    path.write_text(TINY)

    def cells_ended() -> int:
        return len(list(out.glob("cells/*.json")))

    def times() -> int:
        return len(list(out.glob("times/*.parquet")))

    kept: dict[Path, bytes] = {}
    for reached in (lambda: cells_ended() >= 1, lambda: cells_ended() >= 3, lambda: times() >= 1):
        process = begin(path, out, *(["--resume"] if out.exists() else []))
        wait_for(reached, process)
        process.kill()
        process.communicate(timeout=60)
        for file, content in kept.items():
            assert file.read_bytes() == content
        for file in [*out.glob("ticks/*.parquet"), *out.glob("times/*.parquet")]:
            assert len(pl.read_parquet(file)) >= 4, "whole, every one of them"
        # What a cell's record calls done is not done again; a file that was to be recorded next was being run.
        kept = {}
        for record in out.glob("cells/*.json"):
            for folder, part in (("ticks", "accuracy"), ("times", "timing")):
                if (ended := json.loads(record.read_text())[part]) is not None:
                    assert ended["state"] == "done"
                    file = out / folder / f"{record.stem}.parquet"
                    kept[file] = file.read_bytes()
    done = kinqp("sweep", path, "--out", out, "--resume")
    assert done.returncode == 0, done.stderr
    assert cells_ended() == times() == 4
    assert "failed:" not in done.stdout
    assert not list(out.rglob("*.partial"))
    for file, content in kept.items():
        assert file.read_bytes() == content


def begin(config: Path, out: Path, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command("sweep", config, "--out", out, "--workers", "1", *options),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )


def wait_for(reached: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 60.0
    while not reached():
        assert process.poll() is None, "it ended before it could be interrupted"
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_export_writes_a_folder_and_says_what_next(tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ("--formulation", "cartesian-error", "--mode", "line z", "--out", out)
    done = kinqp("export", "--robot", "lbr_med14", *options)
    assert done.returncode == 0, done.stderr
    assert "ctest --test-dir" in done.stdout.replace("\n", " ")
    assert (out / "kinqp_lbr_med14_cartesian_error.c").exists()
    assert not list(out.glob("*guiding*"))
    whole = kinqp("export", "--robot", "lbr_med14", "--guiding", *options)
    assert whole.returncode == 0, whole.stderr
    assert (out / "kinqp_lbr_med14_cartesian_error_guiding.c").exists()
    wrong = kinqp("export", "--robot", "lbr_med41", *options)
    assert wrong.returncode == 2
    assert "lbr_med14" in wrong.stderr
    assert "Traceback" not in wrong.stderr
