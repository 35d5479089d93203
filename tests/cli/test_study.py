"""`kinqp study`, as people call it: it says what it found and where, can be interrupted, and goes on."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest
from typer.testing import CliRunner

from kinqp.benchmarks.study import StudyError, StudyResult, command, run_study, study_settings
from kinqp.cli.app import USER_ERRORS, app

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result

COMMAND = (sys.executable, "-m", "kinqp.cli", "study")
# Coarser than a controller runs, to be quick.
DT = 5e-3
SMALL = ("--operators", "1", "--trials", "1", "--dt", str(DT), "--workers", "1", "--seed", "4")


def kinqp(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["study", *map(str, arguments)])


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small study, of which only the page is missing."""
    folder = tmp_path_factory.mktemp("study") / "out"
    run_study(study_settings(operators=1, trials=1, seed=4, dt=DT), folder, processes=1)
    return folder


def test_it_says_what_it_found_and_where(out: Path) -> None:
    done = kinqp("--out", out, *SMALL, "--resume")
    assert done.exit_code == 0, done.stderr
    assert (out / "index.html").exists()
    for said in ("holds: A stops hard", "question 1, A and C: chi-squared 8.23, printed 8.23", "chi-squared 13.27"):
        assert said in done.stdout
    (page,) = re.findall(r"Next: open (\S+) in a browser", done.stdout)
    assert page == str(out / "index.html")
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["conditions"] == json.loads((out / "conditions.json").read_text(encoding="utf-8"))
    assert summary["settings"]["seed"] == 4


def test_what_is_there_is_not_lost(out: Path) -> None:
    for more, said in (
        ((), "give --resume to continue it, --overwrite to replace it"),
        (("--resume",), "other settings"),
    ):
        done = kinqp("--out", out, *SMALL[:-1], "5", *more)
        assert isinstance(done.exception, StudyError)
        assert said in str(done.exception)
    assert StudyError in USER_ERRORS
    assert StudyResult.read(out).settings.seed == 4


def test_conditions_are_those_of_the_run_that_completed_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = {"cpu": "the first"}
    monkeypatch.setattr(command, "conditions", lambda: dict(now))
    monkeypatch.setattr(command, "run_study", lambda *_given, **_named: None)
    monkeypatch.setattr(command, "write_study", lambda _study, _folder, known, **_named: known)

    def known(**how: bool) -> object:
        return command.run_and_write(study_settings(operators=1, trials=1), tmp_path, **how)

    assert known() == {"cpu": "the first"}
    now["cpu"] = "the second"
    assert known(resume=True) == {"cpu": "the first"}
    assert known(overwrite=True) == {"cpu": "the second"}


def test_nonsense_is_refused(tmp_path: Path) -> None:
    for option in ("--operators", "--trials", "--workers"):
        done = kinqp("--out", tmp_path / "none", option, "0")
        assert done.exit_code == 2
        assert option in done.stderr
    assert not (tmp_path / "none").exists()


@pytest.mark.long
def test_ctrl_c_keeps_the_trials_that_are_done(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    process = subprocess.Popen(
        [*COMMAND, "--out", str(folder), "--operators", "2", "--trials", "9", "--dt", "0.002", "--workers", "1"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ, start_new_session=True,
    )  # fmt: skip
    give_up = time.monotonic() + 120.0
    while not list(folder.glob("trials/*.json")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < give_up
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"Interrupted; {folder} keeps all trials done" in said
    assert re.search(
        r"Next: kinqp study --out \S+ --operators 2 --trials 9 --seed 2018 --dt 0.002 --workers 1 --resume", said
    )
    assert not list(folder.glob("trials/*.partial"))
    assert list(folder.glob("trials/*.json"))
