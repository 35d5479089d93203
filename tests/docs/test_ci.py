"""The CI job in the docs: it is valid, and calls commands and targets that exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import typer
import yaml

from kinqp.cli.app import app

ROOT = Path(__file__).parents[2]
JOB = yaml.safe_load(re.findall(r"```yaml\n(.*?)```", (ROOT / "docs/ci.md").read_text(), flags=re.DOTALL)[0])
STEPS = JOB["jobs"]["compare"]["steps"]
LINES = [line for step in STEPS for line in str(step.get("run", "")).splitlines()]
CALLS = [line for line in LINES if "/bin/kinqp " in line]


def test_base_and_head_are_checked_out_set_up_and_compared_in_this_order() -> None:
    checked_out = [step["with"]["path"] for step in STEPS if str(step.get("uses", "")).startswith("actions/checkout")]
    assert sorted(checked_out) == ["base", "head"]
    assert [shlex.split(line)[1] for line in CALLS] == ["sweep", "sweep", "compare", "report"]
    outs = [words[words.index("--out") + 1] for words in map(shlex.split, CALLS[:2])]
    assert shlex.split(CALLS[2])[2:4] == outs == ["results-base", "results-head"]


@pytest.mark.parametrize("call", CALLS)
def test_commands_and_their_options_exist(call: str) -> None:
    words = shlex.split(call)
    command = typer.main.get_command(app).commands[words[1]]  # type: ignore[attr-defined]  # a group, as any with commands
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    assert {word for word in words if word.startswith("--")} <= known


def test_make_targets_exist() -> None:
    targets = [line.split()[-1] for line in LINES if line.startswith("make ")]
    assert targets == [".venv/.installed"] * 2
    assert "$(VENV)/.installed:" in (ROOT / "Makefile").read_text()
