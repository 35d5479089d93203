"""The examples run, and what they claim holds; that they would say so if it did not."""

from __future__ import annotations

import functools
import importlib
import os
import re
import shlex
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import pytest

from kinqp.control import make_step
from kinqp.formulations import viable_bound, with_constraints
from kinqp.solvers import Status
from kinqp.solvers.native import compiler

if TYPE_CHECKING:
    from types import ModuleType

EXAMPLES = Path(__file__).parents[2] / "examples"


@functools.cache
def quick_compiler() -> str:
    """A command that compiles with less optimisation: the bits do not depend on it, the time to compile does."""
    script = Path(tempfile.mkdtemp()) / "cc"
    script.write_text(f'#!/bin/sh\nexec {shlex.join(compiler())} "$@" -O0\n', encoding="utf-8")
    script.chmod(0o755)
    return str(script)


def run(script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", script, *arguments],
        cwd=EXAMPLES,
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
        env=os.environ | {"KINQP_CC": quick_compiler()},
    )


@pytest.fixture(name="drilling")
def _drilling(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return importlib.import_module("drilling")


def test_all_examples_are_tested() -> None:
    assert {path.name for path in EXAMPLES.glob("*.py")} == {"drilling.py", "drilling_compare.py", "hand_guiding.py"}


@pytest.mark.parametrize("how", [(), pytest.param(("--solver", "clarabel"), marks=pytest.mark.long)])
def test_hand_guiding(how: tuple[str, ...]) -> None:
    done = run("hand_guiding.py", *how)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "ticks not solved: 0" in done.stdout
    # Both modes, and the way from one to the other.
    for words in ("fix-orientation  guiding", "stopping", "line:z           guiding"):
        assert words in done.stdout


@pytest.mark.parametrize(
    ("seconds", "seed"),
    [("5", "0"), pytest.param("60", "0", marks=pytest.mark.long), pytest.param("60", "1", marks=pytest.mark.long)],
)
def test_drilling_keeps_what_is_required(seconds: str, seed: str) -> None:
    done = run("drilling.py", "--seconds", seconds, "--seed", seed)
    assert done.returncode == 0, done.stdout + done.stderr
    verdicts = re.findall(r"\b(ok|BROKEN)\b", done.stdout)
    assert verdicts == ["ok"] * 8
    # It was put to the test: joints on their limits, capsules at their margin, and the drill went in.
    for words, least in (("joint on its limit", 0.5), ("capsules at their margin", 0.5), ("along the line", 15.0)):
        found = re.search(rf"{words} +([\d.]+) ", done.stdout)
        assert found is not None
        assert float(found[1]) > least


@pytest.mark.long
def test_drilling_says_what_is_broken(drilling: ModuleType) -> None:
    """The table of a run that was tampered with shows what was done to it."""
    drilled = drilling.drill(drilling.make_controller("joint-space-robust"), 0.5)
    assert all(row.holds for row in drilling.measure(drilled))
    run, along = drilled.run, drilled.ticks(drilling.DRILL)
    assert len(along) > 100
    assert drilled.ticks(drilling.TURN).size > 100
    position, rotation, q, qd = (np.array(getattr(run, name)) for name in ("position", "rotation", "q", "qd"))
    position[along[50]] += 1e-3 * rotation[along[0]][:, 1]
    rotation[along[60]] = rotation[along[60]] @ pin.exp3(np.deg2rad([0.0, 0.5, 0.0]))
    position[drilled.ticks(drilling.TURN)[70]] += 2e-3 * rotation[drilled.ticks(drilling.TURN)[70]][:, 0]
    q[100, 5] = drilling.ROBOT.q_max[5] + np.deg2rad(0.1)
    # Wrist 2 turned until the drill lies along the forearm.
    q[200] = np.deg2rad([20.0, -80.0, 100.0, -100.0, -160.0, 20.0])
    qd[300] += 0.1
    status = (Status.FAILED, *run.status[1:])
    tampered = replace(run, position=position, rotation=rotation, q=q, qd=qd, status=status)
    rows = {row.what: row for row in drilling.measure(replace(drilled, run=tampered))}
    broken = {what for what, row in rows.items() if not row.holds}
    assert rows["drilling: tip off the line"].value == pytest.approx(1.0, abs=0.02)
    assert rows["drilling: tool turned by"].value == pytest.approx(0.5, abs=0.01)
    assert rows["turning: shaft off the entry"].value == pytest.approx(2.0, abs=0.05)
    assert rows["beyond a joint limit by"].value == pytest.approx(10.0, abs=1e-6)  # wrist 2, 150 deg at most
    assert rows["capsules closer than the margin by"].note == "forearm and drill"
    assert rows["joint acceleration"].value == pytest.approx(100.0, abs=10.0)
    assert rows["ticks not solved"].value == 1
    assert broken == {what for what, row in rows.items() if row.most is not None} - {"leading: tool turned by"}
    assert not drilling.show("tampered with", list(rows.values()))


@pytest.mark.parametrize("mode", ["DRILL", "TURN"])
def test_corrections_give_way_and_not_the_mode(
    drilling: ModuleType, mode: str, capsys: pytest.CaptureFixture[str]
) -> None:
    compare = importlib.import_module("drilling_compare")
    assert compare.slip(getattr(drilling, mode))
    given_up = [int(count) for count in re.findall(r"given up wholly at (\d+) ticks", capsys.readouterr().out)]
    # As the locked rows' correction it is given up as a whole, as the constraint's by the share that is too much.
    assert given_up[0] == (1500 if mode == "DRILL" else 0)
    assert given_up[1] < 50


@pytest.mark.parametrize("formulation", ["joint-space-robust", pytest.param("damped", marks=pytest.mark.long)])
def test_all_together_can_always_be_solved(drilling: ModuleType, formulation: str) -> None:
    """Wherever the arm is, in its window or beyond it, in itself or not, and wherever the entry is beside the shaft."""
    robot, rng, count = drilling.ROBOT, np.random.default_rng(0), 400
    for step in drilling.make_steps(formulation):
        low, high = robot.q_min, robot.q_max
        Q = rng.uniform(low - 0.02, high + 0.02, (count, robot.nv))
        # A third with a joint or two exactly on a limit.
        on = rng.random(Q.shape) < 0.1
        Q = np.where(on, np.where(rng.random(Q.shape) < 0.5, low, high), Q)
        V = rng.normal(size=(count, step.mode.m_free)) * 0.3
        given = {"self_collision_margin": 0.05, "self_collision_deceleration": 0.5}
        if "qd_prev" in step.inputs:
            # As fast as the joint limits ahead allow.
            most = [np.asarray(viable_bound(np.maximum(d, 0.0), robot.qd_max, robot.qdd_max, 1e-3)).reshape(-1)
                    for q in Q for d in (q - low, high - q)]  # fmt: skip
            back, ahead = np.array(most[::2]), np.array(most[1::2])
            given["qd_prev"] = np.clip(rng.normal(size=Q.shape) * 0.2, -back, ahead)
        for k in range(5 if "remote_centre_pivot" in step.inputs else 1):
            if "remote_centre_pivot" in step.inputs:
                pose = robot.pose(Q[k])
                given["remote_centre_pivot"] = pose[:3, 3] - 0.06 * pose[:3, 2] + 0.01 * rng.normal(size=3)
            result = step.batch(Q, V, **given)
            assert set(result.status) == {Status.SOLVED}
            assert np.isfinite(result.qd).all()


def test_the_paper_as_written_draws_the_drill_out(drilling: ModuleType) -> None:
    """Roll against the limit of wrist 3: metres and radians mixed without weights, the tool moves against the hand."""
    lost = {}
    for formulation, weight in (("damped", None), ("joint-space", drilling.WEIGHT)):
        step = make_step(drilling.ROBOT, with_constraints(formulation, ["remote-centre"]), drilling.TURN)
        q = np.deg2rad(drilling.START_DEG)
        q[5] = drilling.ROBOT.q_max[5]
        pose = drilling.ROBOT.pose(q)
        entry = pose[:3, 3] - drilling.INSERTED * pose[:3, 2]
        roll = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        given = {} if weight is None else {"task_weight": weight}
        result = step(q, roll, remote_centre_pivot=entry, **given)
        assert result.status is Status.SOLVED
        twist = drilling.ROBOT.jacobian(q) @ result.qd
        lost[formulation] = float(np.abs(pose[:3, 2] @ twist[:3]))
    assert lost["damped"] > 0.1
    assert lost["joint-space"] < 0.2 * lost["damped"]
