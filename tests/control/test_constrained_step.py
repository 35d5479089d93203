"""Constrained formulations in one control cycle: what must hold of every command."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from kinqp.control import BOUND_TOLERANCE, make_step
from kinqp.formulations import Mode, with_constraints
from kinqp.formulations.constraints import (
    Constraint,
    ContactForce,
    ElbowBend,
    ElbowHold,
    ElbowRange,
    Obstacle,
    Obstacles,
    RemoteCentre,
    SelfCollision,
    SingularityAvoidance,
    TwistLimits,
)
from kinqp.solvers import Status
from tests.control.states import states
from tests.formulations.constraints.rows import RowsOf
from tests.robots.arms import arm

Array = NDArray[np.float64]
DT = 1e-3
FORMULATIONS = ("joint-space", "cartesian-error")
# Inside the working range of both arms, and inside the arm itself.
POST = Obstacle("post", (0.35, 0.1, 0.0), (0.35, 0.1, 0.7), 0.05)
BALL = Obstacle("ball", (0.1, -0.1, 0.45), None, 0.1)
SETS: dict[str, tuple[Constraint, ...]] = {
    "gaps": (SelfCollision(), Obstacles(obstacles=(POST, BALL)), SingularityAvoidance(), TwistLimits()),
    "pivot": (RemoteCentre(pivot=(0.5, 0.0, 0.3)), ContactForce(), TwistLimits(frame="tool")),
    "guided": (SingularityAvoidance(rows="guided"), SelfCollision(approach="step", retreat=False)),
    "elbow": (ElbowRange(), ElbowBend(), SelfCollision(approach="damper")),
    "held": (ElbowHold(correct=True, angle=1.0), RemoteCentre(pivot=(0.5, 0.0, 0.3))),
}
ELBOW_SETS = ("elbow", "held")
# The rest end in the safe stop: states with most joints on their limits, where the optimum is degenerate, and, within
# 1e-6 of the upright posture, modes and pivots whose rows are nearly dependent.
LEAST_SOLVED = 0.97
# To which a solver's answer satisfies rows, relative to their terms [-].
ROWS_TOLERANCE = 2e-8


def check_invariants(robot_name: str, formulation: str, which: str, count: int, modes: tuple[str, ...]) -> None:
    robot = arm(robot_name)
    solved: Counter[bool] = Counter()
    given = {"contact_force_normal": [0.0, 0.6, -0.8], "contact_force_now": 19.9} if which == "pivot" else {}
    for text in modes:
        mode = Mode.parse(text)
        step = make_step(robot, with_constraints(formulation, SETS[which]), mode)
        rows = [RowsOf(constraint, robot, text) for constraint in SETS[which]]
        rng = np.random.default_rng(1)
        for kind, q in states(robot, count):
            v = rng.normal(size=mode.m_free) * rng.choice([1e-6, 0.01, 0.2, 2.0])
            result = step(q, v, **given)
            if kind != "near zero":
                solved[result.status is Status.SOLVED] += 1
            case = f"{text}, {kind}, q={q!r}, v={v!r}: {result.message}"
            assert np.isfinite(result.qd).all(), case
            assert result.status is not Status.PRIMAL_INFEASIBLE, case  # zero motion is feasible
            if result.status is not Status.SOLVED:
                assert not result.qd.any(), case
                continue
            assert (np.abs(result.qd) <= robot.qd_max + BOUND_TOLERANCE).all(), case
            outward = np.where(q >= robot.q_max, result.qd, np.where(q <= robot.q_min, -result.qd, -np.inf))
            assert outward.max() <= BOUND_TOLERANCE, case
            locked = (mode.twist_map_at(robot.pose(q)) @ robot.jacobian(q))[list(mode.fixed_rows)]
            share = np.maximum(np.abs(locked) @ np.abs(result.qd), 1.0)
            assert (np.abs(locked @ result.qd) <= 2e-9 * share).all(), case
            for one in rows:
                check_rows(one(q, v, **given), result.qd, case)
    assert solved[True] >= LEAST_SOLVED * solved.total(), solved


def check_rows(at: dict[str, Array], qd: Array, case: str) -> None:
    """Judge a command from the rows alone: what must hold even where a correction is given up."""
    nv, scale = qd.size, 1.0 + np.abs(qd).sum()
    rate = at["C"][:, :nv] @ qd
    assert (rate >= at["l"] - ROWS_TOLERANCE * scale).all(), case
    assert (rate <= at["u"] + ROWS_TOLERANCE * scale).all(), case
    if at["A"].size:
        moved, correction = at["A"][:, :nv] @ qd, -at["A"][:, nv:].sum(axis=1)
        shared = float(np.clip(moved @ correction / max(correction @ correction, 1e-300), 0.0, 1.0))
        assert np.abs(moved - shared * correction).max() <= ROWS_TOLERANCE * scale, case


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(
    ("robot_name", "which"),
    [*(("lbr_med14", which) for which in SETS), *(("ur5e", which) for which in SETS if which not in ELBOW_SETS)],
)
def test_every_command_is_safe(robot_name: str, which: str, formulation: str) -> None:
    check_invariants(robot_name, formulation, which, 18, ("fix-orientation", "free"))


@pytest.mark.long
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(
    ("robot_name", "which"),
    [*(("lbr_med14", which) for which in SETS), *(("ur5e", which) for which in SETS if which not in ELBOW_SETS)],
)
def test_every_command_is_safe_on_many_states(robot_name: str, which: str, formulation: str) -> None:
    check_invariants(robot_name, formulation, which, 400, ("free", "fix-orientation", "plane:0,1,0", "rcm:0.1"))
