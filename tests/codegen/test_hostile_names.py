"""A robot's, a mode's and a formulation's name are text: whatever they say, the same code comes out."""

import dataclasses
import functools
import re
import subprocess
from pathlib import Path

import pytest

from kinqp.codegen import compile_step
from kinqp.codegen.fields import mode_symbols, prefix_of
from kinqp.codegen.model import StepCode, step_code
from kinqp.codegen.render import render_batch, render_step
from kinqp.control import export_guiding
from kinqp.formulations import CartesianError, Formulation, Mode
from kinqp.robots import Robot
from tests.hostile import HOSTILE
from tests.programs import need
from tests.robots.arms import arm

TRIGRAPHS = dict(zip("=/'()!<>-", "#\\^[]|{}~", strict=True))
names = pytest.mark.parametrize("name", HOSTILE.values(), ids=HOSTILE.keys())


def called(name: str) -> tuple[Robot, Formulation, Mode]:
    """Give robot, formulation and mode this name."""
    made = type("Named", (CartesianError,), {"name": name, "__doc__": CartesianError.__doc__})()
    mode = dataclasses.replace(Mode.line("z"), name=name or "x", argument=name)
    return dataclasses.replace(arm("davinci5"), name=name), made, mode


def without_comments(text: str) -> list[str]:
    """Do what a C compiler does first: trigraphs, joined lines, comments; return the tokens, more or less."""
    text = re.sub(r"\?\?([=/'()!<>-])", lambda match: TRIGRAPHS[match[1]], text).replace("\\\n", "")
    return re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL).split()


@functools.cache
def plain_code() -> StepCode:
    return step_code(arm("davinci5"), CartesianError(), [Mode.line("z")], "k")


def rendered(name: str) -> dict[str, list[str]]:
    """Give the tokens of the C under symbols that the name has no part in."""
    robot, made, mode = called(name)
    code = dataclasses.replace(plain_code(), robot=robot.name, formulation=made.name)
    code = dataclasses.replace(code, modes=tuple(dataclasses.replace(each, text=str(mode)) for each in code.modes))
    files = render_step(code) | {"batch.c": render_batch(code)}
    return {file: without_comments(text) for file, text in files.items()}


@functools.cache
def ordinary() -> dict[str, list[str]]:
    return rendered("arm")


@names
def test_c_without_its_comments_does_not_know_the_name(name: str) -> None:
    assert rendered(name) == ordinary()


@names
def test_files_and_symbols_are_plain(name: str) -> None:
    robot, made, mode = called(name)
    assert re.fullmatch(r"kinqp_?[a-z0-9_]{,170}", prefix_of(robot.name, made.name), flags=re.ASCII)
    assert re.fullmatch(r"[a-z0-9_]*", mode_symbols([mode])[0], flags=re.ASCII)


def test_what_is_exported_compiles_and_reads_the_same(tmp_path: Path) -> None:
    every = "x" + " ".join(name for name in HOSTILE.values() if len(name) < 1000)
    robot, made, mode = called(every)
    out = export_guiding(robot, made, [mode], tmp_path / "out", name="k")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    for source in ("k.c", "k_guiding.c"):
        line = [need("gcc"), "-std=c99", "-trigraphs", "-Wall", "-Werror", "-fsyntax-only", source]
        done = subprocess.run(line, cwd=out, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert "injected" not in (out / "CMakeLists.txt").read_text()
    readme = (out / "README.md").read_text()
    assert "<script" not in readme
    for table in re.findall(r"(?:^\|.*\n)+", readme, flags=re.MULTILINE):
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1, table


def test_a_description_keeps_its_lines_and_tables() -> None:
    robot, made, mode = called(" ".join(HOSTILE.values()))
    plain = CartesianError().describe(arm("davinci5"), "line:z")
    assert len(made.describe(robot, mode).splitlines()) == len(plain.splitlines())
    assert "<script" not in made.describe(robot, mode)


def test_a_step_of_a_robot_with_such_a_name_runs() -> None:
    robot = dataclasses.replace(arm("davinci5"), name=HOSTILE["lines"] + HOSTILE["end of a comment"])
    step = compile_step(robot, "cartesian-error", "line:z")
    assert step([0.0, 0.1, 0.0, 0.0, 0.0], [0.01]).status.value == "solved"
