"""docs/new-formulation.md, done: its two files in a project of their own, installed, listed, swept, exported."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.codegen.test_export import check

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "new-formulation.md").read_text(encoding="utf-8")
KINQP = Path(sys.executable).parent / "kinqp"


def block(language: str, index: int = 0) -> str:
    return str(re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)[index])


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("newcomer")
    (folder / "my_formulations.py").write_text(block("py"))
    (folder / "pyproject.toml").write_text(block("toml"))
    # The page's sweep is the whole semicircle; two hundredths of a second of it will do here.
    (folder / "sweep.toml").write_text(block("toml", 1) + 'scenarios = ["tests.benchmarks.tiny:tiny"]\n')
    return folder


@pytest.fixture(scope="module")
def installed(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("site")
    offline = ("--no-index", "--no-deps", "--no-build-isolation", "--disable-pip-version-check", "--quiet")
    line = [sys.executable, "-m", "pip", "install", *offline, "--target", str(target), str(project)]
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return target


def run(words: list[str], folder: Path, *paths: Path) -> str:
    """Run a command of the page in a folder and return what it prints."""
    assert words[0] == "kinqp"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths))}
    done = subprocess.run(
        [str(KINQP), *words[1:]], cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def commands() -> dict[str, list[str]]:
    lines = [line.split() for line in block("sh").splitlines() if line.startswith("kinqp ")]
    return {words[1]: words for words in lines}


def test_it_is_short() -> None:
    lines = [line for text in (block("py"), block("toml")) for line in text.splitlines() if line.strip()]
    assert len(lines) < 40


def test_without_it_nobody_knows_it(project: Path) -> None:
    assert "resting" not in run(["kinqp", "list"], project, ROOT)


def test_it_is_listed_described_swept_and_exported(project: Path, installed: Path, tmp_path: Path) -> None:
    (tmp_path / "sweep.toml").write_text((project / "sweep.toml").read_text())
    assert set(commands()) == {"list", "describe", "sweep", "export"}
    printed = {name: run(words, tmp_path, installed, ROOT) for name, words in commands().items()}
    assert re.search(r"resting +Smallest Cartesian error; what the hand leaves free", printed["list"])
    assert "# `resting` on `lbr_med14`, mode `fix-orientation`" in printed["describe"]
    assert "| joint limits | bound | 7 | x[0-6] |" in printed["describe"]
    (row,) = [line for line in printed["sweep"].splitlines() if line.split()[:1] == ["resting"]]
    assert row.split()[1] == "active-set"
    assert len(list((tmp_path / "results" / "ticks").glob("*resting*.parquet"))) == 2
    done = check(tmp_path / "resting_c")
    assert done.returncode == 0, done.stdout
    assert "400 ticks" in done.stdout


def test_without_packaging_it_is_found_in_the_working_folder(project: Path) -> None:
    words = [word.replace("resting", "my_formulations:Resting", 1) for word in commands()["describe"]]
    assert "my_formulations:Resting" in words
    assert "`q_rest`" in run(words, project)


def test_a_broken_package_does_not_hide_the_others(project: Path, installed: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken-1.0.dist-info"
    broken.mkdir()
    (broken / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (broken / "entry_points.txt").write_text("[kinqp.formulations]\nbroken = no_such_module:Broken\n")
    listed = run(["kinqp", "list"], project, installed, tmp_path, ROOT)
    assert "joint-space" in listed
    assert "resting" in listed
    assert "No module named 'no_such_module'" in listed
