"""Constrained formulations in the closed loop: hands that push where they should not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from kinqp.control import BOUND_TOLERANCE, Trajectory, make_step, simulate
from kinqp.formulations import with_constraints
from kinqp.formulations.constraints import (
    Constraint,
    ContactForce,
    ElbowBend,
    ElbowHold,
    ElbowRange,
    GapConstraint,
    Obstacle,
    Obstacles,
    RemoteCentre,
    SelfCollision,
    SingularityAvoidance,
    TwistLimits,
)
from kinqp.solvers import Status
from tests.formulations.constraints.rows import RowsOf
from tests.formulations.constraints.test_posture_rows import angle_by_hand
from tests.robots.arms import arm

if TYPE_CHECKING:
    from kinqp.robots import Robot


Array = NDArray[np.float64]
# The loop at 500 Hz: what is lost to linearisation grows with the square of the period.
DT = 2e-3
BOTH = ("joint-space", pytest.param("cartesian-error", marks=pytest.mark.long))


@dataclass(frozen=True)
class Push:
    """A hand that pushes along world axes: each twist for `each` seconds, faded in over 0.3 s."""

    twists: tuple[tuple[float, ...], ...]
    each: float = 1.0

    def twist(self, t: float, pose: Array) -> Array:
        del pose
        return min(t / 0.3, 1.0) * np.array(self.twists[min(int(t / self.each), len(self.twists) - 1)])


class Watch:
    """Gaps along a run, and by how much each period misses what the linear rows said."""

    def __init__(self, constraint: GapConstraint, robot: Robot, run: Trajectory) -> None:
        rows = RowsOf(replace(constraint, approach="step", retreat=False), robot)
        offset = f"{constraint.name.replace('-', '_')}_margin"
        # A margin far below zero makes every bound positive, so that the step form shows the gap itself.
        lower, C = rows.along(np.vstack([run.q, run.q_end]), dt=DT, **{offset: -10.0})
        self.gap = -lower * DT - 10.02
        self.rate = np.einsum("tij,tj->ti", C[:-1], run.qd)
        self.linearisation = np.abs(self.gap[1:] - self.gap[:-1] - DT * self.rate).max(axis=1)


def run(
    robot: Robot, formulation: str, constraints: list[Constraint], mode: str, push: Push, q0: Array, seconds: float
) -> Trajectory:
    step = make_step(robot, with_constraints(formulation, constraints), mode)
    trajectory = simulate(step, push, q0, seconds, dt=DT)
    assert set(trajectory.status) == {Status.SOLVED}
    return trajectory


FOLDED = np.deg2rad([0.0, 40.0, 0.0, -90.0, 0.0, 50.0, 0.0])
# What these runs lose to linearisation with retreat, 3 s at 0.3 m/s: 4.3 um at most at 500 Hz as here, 0.7 um at 1 kHz.
# Twice that is allowed [m].
LOST = 9e-6


@pytest.mark.parametrize("formulation", BOTH)
@pytest.mark.parametrize("approach", ["viable", pytest.param("step", marks=pytest.mark.long)])
def test_the_hand_pushes_the_arm_into_itself(formulation: str, approach: str) -> None:
    robot = arm("lbr_med14")
    constraint = SelfCollision(approach=approach)
    trajectory = run(robot, formulation, [constraint], "position", Push(((-0.3, 0.05, -0.25, 0, 0, 0),)), FOLDED, 3.0)
    watch = Watch(constraint, robot, trajectory)
    assert watch.gap[0].min() > 0.05
    assert watch.gap.min() < 1e-3  # it got there
    assert watch.gap.min() > -LOST
    assert any(name.startswith("self-collision[") for names in trajectory.active for name in names)
    # Without the constraint the same push ends inside.
    bare = simulate(
        make_step(robot, formulation, "position"), Push(((-0.3, 0.05, -0.25, 0, 0, 0),)), FOLDED, 3.0, dt=DT
    )
    assert Watch(constraint, robot, bare).gap.min() < -0.05


@pytest.mark.parametrize("formulation", BOTH)
@pytest.mark.parametrize("mode", ["position", pytest.param("fix-orientation", marks=pytest.mark.long)])
def test_the_hand_pushes_the_forearm_along_a_post(mode: str, formulation: str) -> None:
    robot = arm("lbr_med14")
    post = Obstacle("post", (0.376, 0.2, -0.5), (0.376, 0.2, 0.6), 0.04)
    push = Push(((0, 0.25, 0, 0, 0, 0), (0.1, 0.2, -0.1, 0, 0, 0), (-0.2, 0.25, 0.1, 0, 0, 0)))
    lowest, errors = {}, {}
    for retreat in (True, False):
        constraint = Obstacles(obstacles=(post,), retreat=retreat)
        watch = Watch(constraint, robot, run(robot, formulation, [constraint], mode, push, FOLDED, 3.0))
        lowest[retreat], errors[retreat] = watch.gap.min(), watch.linearisation[watch.gap[:-1].min(axis=1) < 0.01]
        assert watch.gap.min() < 1e-4
    assert lowest[True] > -LOST
    # What is lost per period, and that it adds up where nothing is ever taken back.
    assert max(errors[True].max(), errors[False].max()) < 4e-6
    assert lowest[True] >= lowest[False]
    assert lowest[False] > -errors[False].sum() - LOST


def test_approach_decelerates_as_told() -> None:
    """Straight at a ball: the viable bound stops the hand at 2 m/s^2, the step bound within one period."""
    robot = arm("lbr_med14")
    ball = Obstacle("ball", tuple(robot.pose(FOLDED)[:3, 3] + [0.3, 0.0, 0.0]), None, 0.08)
    hardest = {}
    for approach in ("viable", "step"):
        constraint = Obstacles(obstacles=(ball,), approach=approach)
        push = Push(((0.25, 0, 0, 0, 0, 0),))
        watch = Watch(constraint, robot, run(robot, "joint-space", [constraint], "fix-orientation", push, FOLDED, 1.2))
        nearest = watch.rate[np.arange(len(watch.rate)), watch.gap[:-1].argmin(axis=1)]
        hardest[approach] = np.diff(nearest).max() / DT
        assert -LOST < watch.gap.min() < 1e-4
    assert hardest["viable"] < 1.1 * 2.0
    assert hardest["step"] > 20.0


def test_an_arm_inside_an_obstacle_stays_until_it_is_guided_out() -> None:
    robot = arm("lbr_med14")
    tip = robot.pose(FOLDED)[:3, 3]
    ball = Obstacle("ball", (tip[0] + 0.1, tip[1], tip[2]), None, 0.08)  # some 7 cm too deep, margin counted
    step = make_step(robot, with_constraints("joint-space", [Obstacles(obstacles=(ball,))]), "fix-orientation")
    away = np.array([-1.0, 0.0, 0.0])
    at_rest, further, out = step(FOLDED, 0 * away), step(FOLDED, -0.1 * away), step(FOLDED, 0.1 * away)
    assert not np.abs(at_rest.qd).max() > 1e-12
    J = robot.jacobian(FOLDED)[:3]
    assert further.status is out.status is Status.SOLVED
    assert (J @ further.qd)[0] < 0.0  # gives way, whatever the hand says
    np.testing.assert_allclose(J @ out.qd, 0.1 * away, atol=2e-3)  # nothing holds it back
    # A joint that can't follow leaves "no further" of it: all joints at a limit of zero speed.
    stuck = step(FOLDED, -0.1 * away, qd_max=1e-9)
    assert stuck.status is Status.SOLVED
    assert np.abs(stuck.qd).max() <= 1e-9 + BOUND_TOLERANCE


@pytest.mark.parametrize("formulation", BOTH)
def test_the_hand_pushes_into_the_manipulability_bound_and_back(formulation: str) -> None:
    robot = arm("lbr_med14")
    q0 = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
    outward = robot.pose(q0)[:3, 3] - [0.0, 0.0, 0.36]
    outward = 0.15 * outward / np.linalg.norm(outward)
    push = Push(((*outward, 0, 0, 0), (*outward, 0, 0, 0), (*-outward, 0, 0, 0)))
    trajectory = run(robot, formulation, [SingularityAvoidance()], "fix-orientation", push, q0, 3.0)
    measure = [np.prod(np.linalg.svd(robot.jacobian(q), compute_uv=False)) for q in trajectory.q]
    assert measure[0] > 0.1
    # Measured: 0.0200000 at the least; the linearisation of the step form loses 7e-6.
    assert 0.02 - 1e-5 < min(measure) < 0.0201
    assert measure[-1] > 0.06  # not stuck: the way back is free


@pytest.mark.parametrize(
    "mode", ["free", *(pytest.param(m, marks=pytest.mark.long) for m in ("position", "fix-orientation"))]
)
def test_the_arm_angle_is_held_and_led(mode: str) -> None:
    robot = arm("lbr_med14")
    q0 = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
    start = angle_by_hand(robot, q0)
    push = Push(((0.1, 0.1, -0.05, 0.1, 0.2, 0.1), (0.1, 0.1, -0.05, 0, 0, 0.1), (-0.1, -0.1, 0.05, 0.1, -0.2, 0)), 0.5)
    ends: dict[str, Array] = {}
    for label, constraints in (
        ("free", []),
        ("held", [ElbowHold()]),
        ("corrected", [ElbowHold(correct=True, angle=start)]),
        ("led", [ElbowHold(correct=True, angle=start + 0.1)]),
        ("ranged", [ElbowRange()]),
    ):
        trajectory = run(robot, "joint-space", [*constraints, ElbowBend()], mode, push, q0, 1.5)
        ends[label] = np.array([angle_by_hand(robot, q) for q in trajectory.q]) - start
    assert np.ptp(ends["free"]) > 2e-3
    # Held, the angle drifts with the square of the period; corrected, it does not add up. Measured 4e-5 and 5e-6.
    assert np.ptp(ends["held"]) < 1e-4
    assert np.ptp(ends["corrected"]) < 1e-5
    assert ends["led"][-1] == pytest.approx(0.1, abs=1e-3)
    assert np.abs(np.diff(ends["led"])).max() < 0.2 * DT + 1e-6
    np.testing.assert_allclose(ends["ranged"], ends["free"], atol=1e-6)  # far inside its range


def test_the_arm_angle_stops_at_the_end_of_its_range() -> None:
    robot = arm("lbr_med14")
    q0 = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
    start = angle_by_hand(robot, q0)
    push = Push(((0.0, 0.2, 0.0, 0, 0, 0),))
    step = make_step(robot, with_constraints("joint-space", [ElbowRange(), ElbowBend()]), "position")
    free, q, angles = np.array(q0), np.array(q0), []
    bare = make_step(robot, with_constraints("joint-space", [ElbowBend()]), "position")
    for tick in range(750):
        v = push.twist(tick * DT, robot.pose(q))[:3]
        result = step(q, v, elbow_range_angle=start, elbow_range_width=0.02)
        assert result.status is Status.SOLVED
        q = q + DT * result.qd
        free = free + DT * bare(free, v).qd
        angles.append(angle_by_hand(robot, q) - start)
    assert abs(angle_by_hand(robot, free) - start) > 0.05
    assert 0.0199 < np.abs(angles).max() < 0.02 + 1e-5


@pytest.mark.parametrize("formulation", BOTH)
def test_an_arm_kept_bent_never_stretches(formulation: str) -> None:
    """The LBR's elbow is 0.05 m off the line at A4 = 14.02 deg: 0.42 * 0.40 * sin(A4) / |SW|."""
    robot = arm("lbr_med14")
    q0 = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
    outward = robot.pose(q0)[:3, 3] - [0.0, 0.0, 0.36]
    push = Push(((*(0.3 * outward), 0, 0, 0),))
    trajectory = run(robot, formulation, [ElbowBend()], "position", push, q0, 2.0)
    assert np.rad2deg(trajectory.q[:, 3].max()) == pytest.approx(-14.02, abs=0.01)


@pytest.mark.parametrize("formulation", BOTH)
@pytest.mark.parametrize("mode", ["free", pytest.param("position", marks=pytest.mark.long)])
def test_the_shaft_stays_in_the_pivot_and_returns_to_it(mode: str, formulation: str) -> None:
    robot = arm("lbr_med14")
    q0 = np.deg2rad([10.0, 30.0, 5.0, -80.0, -5.0, 60.0, 0.0])
    pose = robot.pose(q0)
    push = Push(((0.1, 0.1, -0.05, 0.1, 0.1, 0), (-0.1, 0.05, -0.05, 0, -0.2, 0.1)))
    for beside in (0.0, 0.01):
        pivot = pose[:3, 3] - 0.15 * pose[:3, 2] + beside * pose[:3, 0]
        trajectory = run(robot, formulation, [RemoteCentre(pivot=tuple(pivot))], mode, push, q0, 2.0)
        offsets = []
        for q in trajectory.q:
            now = robot.pose(q)
            offsets.append(np.linalg.norm(now[:3, :2].T @ (pivot - now[:3, 3])))
        assert offsets[0] == pytest.approx(beside, abs=1e-12)
        # Drift of the square of the period, corrected at 10/s: measured 7e-6 m.
        assert offsets[-1] < 2e-5
        assert max(offsets) < beside + 2e-5
        # 20 mm/s at most: 10 mm take half a second.
        if beside:
            assert offsets[round(0.3 / DT)] == pytest.approx(0.01 - 0.3 * 0.02, abs=2e-4)
        assert np.linalg.norm(np.diff(trajectory.position, axis=0), axis=1).sum() > 0.05


def test_the_hand_presses_no_harder_than_allowed() -> None:
    """A wall of 10 N/mm in front of the tool: the force settles at the bound, like an admittance, without overshoot."""
    robot = arm("lbr_med14")
    step = make_step(robot, with_constraints("joint-space", [ContactForce()]), "fix-orientation")
    q, wall, forces = np.array(FOLDED), robot.pose(FOLDED)[0, 3] + 0.005, []
    for _ in range(500):
        force = 1e4 * max(robot.pose(q)[0, 3] - wall, 0.0)
        forces.append(force)
        result = step(q, [0.1, 0.05, 0.0], contact_force_normal=[1.0, 0.0, 0.0], contact_force_now=force)
        assert result.status is Status.SOLVED
        q = q + DT * result.qd
    assert max(forces) < 20.01
    assert forces[-1] == pytest.approx(20.0, abs=0.05)


def test_twist_limits_hold_and_slow_the_hand_down() -> None:
    robot = arm("lbr_med14")
    for frame in ("world", "tool"):
        step = make_step(robot, with_constraints("joint-space", [TwistLimits(frame=frame)]), "free")
        result = step(FOLDED, [0.6, -0.3, 0.1, 0.5, 0.0, 0.0], twist_limits_angular=0.2)
        assert result.status is Status.SOLVED
        twist = robot.jacobian(FOLDED) @ result.qd
        turn = robot.pose(FOLDED)[:3, :3] if frame == "tool" else np.eye(3)
        assert np.abs(turn.T @ twist[:3]).max() == pytest.approx(0.25, abs=1e-8)
        assert np.abs(turn.T @ twist[3:]).max() <= 0.2 + 1e-8
        assert any(name.startswith(("twist-limits[0]", "twist-limits[2]")) for name in result.active)
