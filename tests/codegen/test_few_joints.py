"""Arms with fewer joints than a mode locks rows: some equalities then depend on the others, at every state."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING
from unittest import mock

import numpy as np
import pytest

import kinqp.codegen.step as step_module
from kinqp.codegen import CompiledStep, compile_step
from kinqp.control import InterpretedStep, make_step
from kinqp.formulations import available_formulations
from kinqp.solvers import Status
from tests.codegen.compiled import QUICK_FLAGS, REFERENCE_SOLVER, SPEEDS
from tests.formulations.reference import rows_at
from tests.robots.arms import arm
from tests.robots.chains import chain, scara

if TYPE_CHECKING:
    from kinqp.robots import Robot

# One of each way to keep locked rows: equalities, with a task that is one too, by what goes with the hand, levels.
SHORT = ("joint-space", "minimum-velocity-norm", "cartesian-error", "hierarchical")
SPINDLE = np.array([0.0, 0.0, 1.0, 0.0])


@functools.cache
def steps(robot: Robot, formulation: str, mode: str) -> tuple[CompiledStep, InterpretedStep]:
    """Give the compiled step, and the interpreted one."""
    with mock.patch.object(step_module, "STEP_FLAGS", QUICK_FLAGS):
        return compile_step(robot, formulation, mode), make_step(robot, formulation, mode, REFERENCE_SOLVER)


@pytest.mark.parametrize(
    "formulation",
    [*SHORT, *(pytest.param(name, marks=pytest.mark.long) for name in available_formulations() if name not in SHORT)],
)
def test_a_scara_arm_moves_along_its_spindle(formulation: str) -> None:
    """Five locked rows, four joints: the spindle alone gives what the hand asks for, and moves no locked row."""
    rng = np.random.default_rng(0)
    compiled, interpreted = steps(scara(), formulation, "line:z")
    for speed in (0.1, -0.2, 0.0, 0.3):
        q = rng.uniform([-2.0, -2.0, 0.1, -2.0], [2.0, 2.0, 0.15, 2.0])
        # Formulations of the acceleration go on from the last command.
        memory = {"qd_prev": speed * SPINDLE} if "qd_prev" in compiled.inputs else {}
        for step in (compiled, interpreted):
            result = step(q, [speed], **memory)
            assert result.status is Status.SOLVED
            # Damping and weights of the joints cost some of the speed.
            np.testing.assert_allclose(result.qd, speed * SPINDLE, rtol=0, atol=5e-3 * abs(speed) + 1e-12)
        np.testing.assert_allclose(compiled(q, [speed], **memory).qd, result.qd, rtol=0, atol=1e-9)


@pytest.mark.parametrize("formulation", ["joint-space", "minimum-velocity-norm"])
def test_rounding_in_rows_that_no_joint_moves_contradicts_nothing(formulation: str) -> None:
    """The tool hangs by a turn of pi, which no double is: a locked row is 1e-16, and so is what is asked of it."""
    robot, rng = scara(), np.random.default_rng(1)
    compiled, _ = steps(robot, formulation, "line:z")
    for _ in range(20):
        q = robot.random_configuration(rng)
        _, locked = rows_at(robot, compiled.mode, q)
        drift = locked @ rng.normal(size=4) * 0.02
        sizes = np.abs(locked).max(axis=1)
        assert ((sizes > 0.0) & (sizes < 1e-14)).any()
        result = compiled(q, [0.0], v_fixed=drift)
        assert result.status is Status.SOLVED
        np.testing.assert_allclose(locked @ result.qd, drift, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("axes", "mode"),
    [
        pytest.param(1, "line:z", marks=pytest.mark.long),
        (4, "plane:1,-2,0.5"),
        pytest.param(2, "fix-position", marks=pytest.mark.long),
        pytest.param(3, "line:z", marks=pytest.mark.long),
        pytest.param(3, "rcm:-0.12", marks=pytest.mark.long),
        pytest.param(3, "free", marks=pytest.mark.long),
        pytest.param(5, "line:z", marks=pytest.mark.long),
    ],
)
@pytest.mark.parametrize("formulation", SHORT)
def test_compiled_and_interpreted_steps_agree(formulation: str, axes: int, mode: str) -> None:
    robot, rng = chain(axes), np.random.default_rng(axes)
    compiled, interpreted = steps(robot, formulation, mode)
    for _ in range(20):
        q = robot.random_configuration(rng)
        v = rng.normal(size=compiled.mode.m_free) * rng.choice(SPEEDS)
        result, wanted = compiled(q, v), interpreted(q, v)
        assert result.status is wanted.status is Status.SOLVED
        np.testing.assert_allclose(result.qd, wanted.qd, rtol=0, atol=1e-9)


def test_an_arm_with_a_remote_centre_and_a_mode_that_locks_five_rows() -> None:
    """Five joints, seven equalities: the trocar's two rows beside the mode's five."""
    robot, rng = arm("davinci5"), np.random.default_rng(0)
    compiled, interpreted = steps(robot, "joint-space + remote-centre", "line:z")
    for _ in range(20):
        q = robot.random_configuration(rng)
        v = rng.normal(size=1) * rng.choice(SPEEDS)
        pose = robot.pose(q)
        # On the shaft, or beside it, so that there is drift to correct.
        pivot = pose[:3, 3] - 0.05 * pose[:3, 2] + rng.choice([0.0, 1e-3]) * pose[:3, 0]
        result, wanted = (step(q, v, remote_centre_pivot=pivot) for step in (compiled, interpreted))
        assert result.status is wanted.status is Status.SOLVED
        np.testing.assert_allclose(result.qd, wanted.qd, rtol=0, atol=1e-9)
