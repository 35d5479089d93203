"""The C of a hierarchy beside its cascade in cvxpy: another modeller, another solver, nothing of ours in between."""

from __future__ import annotations

import numpy as np
import pytest

from kinqp.formulations import Hierarchical
from kinqp.formulations.cvxpy_cascade import CvxpyCascade
from kinqp.solvers import Status
from tests.codegen.compiled import compiled
from tests.robots.arms import arm

# Closer to a singularity what Clarabel leaves of the task level's cost is too much of the command.
REGULAR = 0.05


@pytest.mark.parametrize(
    ("robot", "mode"),
    [
        ("lbr_med14", "fix-orientation"),
        ("ur5e", "line:z"),
        pytest.param("lbr_med7", "fix-position", marks=pytest.mark.long),
        pytest.param("lbr_med14", "rcm:-0.1", marks=pytest.mark.long),
    ],
)
def test_compiled_hierarchies_are_the_cascade_in_cvxpy(robot: str, mode: str) -> None:
    step = compiled(robot, "hierarchical", mode, quick=True)
    written = Hierarchical().to_cvxpy(arm(robot), mode)
    assert isinstance(written, CvxpyCascade)
    rng = np.random.default_rng(11)
    compared = held = 0
    for index in range(30):
        q = arm(robot).random_configuration(rng)
        if index % 2:
            on = rng.choice(q.size, size=2, replace=False)
            q[on] = np.where(rng.random(2) < 0.5, arm(robot).q_min[on], arm(robot).q_max[on])
        v = rng.normal(size=step.mode.m_free) * rng.choice([0.02, 0.5])
        J = step.mode.twist_map_at(arm(robot).pose(q)) @ arm(robot).jacobian(q)
        if np.linalg.svd(J, compute_uv=False)[-1] < REGULAR:
            continue
        out = step(q, v, posture_gain=[0.5])
        assert out.status is Status.SOLVED
        qd = written.solve("CLARABEL", q=q, v=v, posture_gain=0.5)
        np.testing.assert_allclose(out.qd, qd, rtol=0, atol=2e-5)
        compared += 1
        held += bool(out.active)
    assert compared >= 8
    assert held >= 4
