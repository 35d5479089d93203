"""Locked rows that a pseudo-inverse keeps: what rounding leaves in them grows with the hand, and is looked at."""

from __future__ import annotations

import numpy as np
import pytest

from kinqp.benchmarks.invariants import States, arm
from kinqp.codegen import compile_step
from kinqp.formulations import Mode
from kinqp.solvers import Status


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
