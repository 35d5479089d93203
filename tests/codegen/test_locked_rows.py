"""Locked rows that a pseudo-inverse keeps: what rounding leaves in them grows with the hand, and is looked at."""

from __future__ import annotations

import numpy as np
import pytest

from kinqp.benchmarks.invariants import States, arm
from kinqp.benchmarks.invariants.states import mode_rows
from kinqp.codegen import compile_step
from kinqp.formulations import Mode
from kinqp.solvers import Status
from tests.codegen.compiled import compiled, interpreted


@pytest.mark.parametrize("formulation", ["cartesian-error", "cartesian-error-acceleration"])
def test_a_command_that_breaks_them_is_refused(formulation: str) -> None:
    robot, mode = arm("ur5e"), Mode.fix_orientation()
    step = compile_step(robot, formulation, mode)
    states = States(robot, mode, seed=0).take(1_200)
    # Hands of 1000 m/s: no one has them, but a broken sensor may say so.
    assert np.linalg.norm(states.v, axis=1).max() > 1_000.0
    inputs = {"qd_prev": states.qd_prev} if "qd_prev" in step.inputs else {}
    result = step.batch(states.q, states.v, **inputs)
    solved = np.array([status is Status.SOLVED for status in result.status])
    left = np.abs(np.einsum("nij,nj->ni", states.J_fixed, result.qd))
    share = np.einsum("nij,nj->ni", np.abs(states.J_fixed), np.abs(result.qd))
    assert solved.sum() > 1_100
    assert (left <= 1e-9 * np.maximum(share, 1.0))[solved].all()
    huge = np.linalg.norm(states.v, axis=1) > 100.0
    refused = [
        status for status, counts in zip(result.status, huge, strict=True) if counts and status is not Status.SOLVED
    ]
    assert Status.INACCURATE in refused


TURN = 2.0 * np.pi
# Of the locked rows' singular values one is 9e-10, of the joints all but one are held by limits. What projecting on the
# null space rounds off is then all that is left of a motion of 1e-2 rad/s, by a hand of 0.3 m/s.
HELD = (
    ("cartesian-error-robust", "fix-orientation", [0.015396873338835926, 0.2789482128025064, -0.13459048351484476],
     [0.013605321664420085, -0.008000932362355427, 0.0, -0.019851227750160613, 0.02139700976201073, 0.0]),
    ("cartesian-error-robust", "plane:1,-2,0.5", [0.015396873338835926, 0.2789482128025064],
     [0.0, 0.0, -0.8000932362355428, 0.0, 0.0, 0.0]),
)  # fmt: skip


@pytest.mark.parametrize(("formulation", "mode", "v", "qd_prev"), HELD)
def test_so_is_one_of_a_slow_hand_where_rows_are_active(
    formulation: str, mode: str, v: list[float], qd_prev: list[float]
) -> None:
    q = np.array([-TURN, TURN, np.pi, TURN, -TURN - 1e-9, TURN])
    rows = mode_rows(arm("ur5e"), Mode.parse(mode), q)[list(Mode.parse(mode).fixed_rows)]
    case = ("ur5e", formulation, mode)
    for step in (compiled(*case, quick=True), interpreted(*case)):
        result = step(q, v, qd_prev=qd_prev)
        assert result.status in (Status.SOLVED, Status.INACCURATE)
        # A safe stop brakes from the last command, which is anything here.
        most = 1e-9 if result.status is Status.SOLVED else np.abs(rows @ qd_prev).max() + 1e-9
        assert np.abs(rows @ result.qd).max() <= most
