"""Constrained formulations as C: the same commands as the interpreted ones, and a library that checks itself."""

from __future__ import annotations

import subprocess
from typing import TYPE_CHECKING
from unittest import mock

import numpy as np
import pytest

import kinqp.codegen.step as step_module
from kinqp.codegen import compile_step, export_c
from kinqp.control import make_step
from kinqp.solvers import Status
from kinqp.solvers.native import compiler
from tests.codegen.compiled import QUICK_FLAGS, SPEEDS
from tests.control.states import states
from tests.robots.arms import arm

if TYPE_CHECKING:
    from pathlib import Path

GAPS = "self-collision + obstacles(spheres=1, bars=1) + singularity + twist-limits + contact-force"
ROWS = "remote-centre(pivot=0.5 0 0.3)"
CASES = [
    ("lbr_med14", "joint-space", f"{GAPS} + elbow-range + elbow-bend"),
    ("lbr_med14", "cartesian-error", f"elbow-hold(correct=1, angle=1) + {ROWS}"),
    ("ur5e", "cartesian-error", GAPS),
    ("ur5e", "joint-space", f"self-collision(approach=damper) + {ROWS}"),
]
GIVEN = {
    "obstacles_sphere1_start": [0.3, 0.1, 0.5],
    "obstacles_bar1_start": [0.4, -0.3, 0.0],
    "obstacles_bar1_end": [0.4, -0.3, 0.8],
    "contact_force_normal": [0.0, 0.6, -0.8],
    "contact_force_now": [15.0],
}
TOLERANCE = 1e-9


def _allowed(robot_name: str, kind: str) -> float:
    """How far commands may be apart: what is left of the digits where rows are dependent up to rounding.

    That is within 1e-6 of the upright posture, and, on the UR5e, with joints at +-360 deg, where the wrist is singular
    and the interpreted solver's own tolerance of 1e-9 is amplified. Measured: 5e-4 and 4e-6.
    """
    if kind == "near zero":
        return 2e-3
    return 1e-5 if robot_name == "ur5e" and kind in ("on limits", "most on limits") else TOLERANCE


def check_parity(robot_name: str, formulation: str, constraints: str, mode: str, count: int) -> None:
    robot = arm(robot_name)
    text = f"{formulation} + {constraints}"
    reference = make_step(robot, text, mode)
    with mock.patch.object(step_module, "STEP_FLAGS", QUICK_FLAGS):
        step = compile_step(robot, text, mode)
    given = {name: value for name, value in GIVEN.items() if name in step.inputs}
    rng = np.random.default_rng(0)
    compared = 0
    for kind, q in states(robot, count):
        v = rng.normal(size=step.mode.m_free) * rng.choice(SPEEDS)
        case = f"{text}, {mode}, {kind}, q={q!r}, v={v!r}"
        result, wanted = step(q, v, **given), reference(q, v, **given)
        for one in (result, wanted):
            assert one.status is Status.SOLVED or not one.qd.any(), case
            # Rounding can make rows that are dependent up to 1e-6 contradict each other; that tick is a safe stop.
            assert one.status is not Status.PRIMAL_INFEASIBLE or kind == "near zero", case
        if result.status is wanted.status is Status.SOLVED:
            allowed = _allowed(robot_name, kind)
            scale = max(1.0, float(np.abs(wanted.qd).max()))
            assert np.abs(result.qd - wanted.qd).max() <= allowed * scale, case
            compared += 1
    assert compared >= 0.9 * count


@pytest.mark.parametrize(("robot_name", "formulation", "constraints"), CASES)
def test_compiled_equals_interpreted(robot_name: str, formulation: str, constraints: str) -> None:
    check_parity(robot_name, formulation, constraints, "fix-orientation", 60)


@pytest.mark.long
@pytest.mark.parametrize("mode", ["free", "position", "plane:0,1,0", "fix-orientation"])
@pytest.mark.parametrize(("robot_name", "formulation", "constraints"), CASES)
def test_compiled_equals_interpreted_on_many_states(
    robot_name: str, formulation: str, constraints: str, mode: str
) -> None:
    check_parity(robot_name, formulation, constraints, mode, 600)


@pytest.mark.parametrize(
    ("text", "parameter"),
    [
        (f"cartesian-error + {ROWS} + twist-limits", "remote_centre_pivot[3]"),
        pytest.param("joint-space + self-collision", "self_collision_margin", marks=pytest.mark.long),
    ],
)
def test_an_exported_library_compiles_and_repeats_its_ticks(text: str, parameter: str, tmp_path: Path) -> None:
    folder = export_c(arm("lbr_med14"), text, ["fix-orientation", "position"], tmp_path / "c")
    assert parameter in next(folder.glob("kinqp_*.h")).read_text(encoding="utf-8")
    sources = [str(path) for path in folder.glob("*.c")]
    program = tmp_path / "check"
    subprocess.run([*compiler(), "-std=c99", "-O1", *sources, "-o", str(program), "-lm"], check=True, cwd=folder)
    done = subprocess.run([str(program)], check=True, capture_output=True, text=True, cwd=folder)
    assert "ticks" in done.stdout
