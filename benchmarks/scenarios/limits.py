"""`limit-corner`, `start-outside-limits`, `infeasible`: joints at their limits, beyond them, and asked for too much."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...formulations import DEFAULT_DT, Mode
from ...robots import load_robot
from ...solvers import Status
from .base import Phase, Scenario, States
from .strokes import pull, rest, strokes

# Elbow and sixth joint on their lower limits at once, the tool level.
CORNER_DEG: Final = (0.0, 90.0, 0.0, -120.0, 0.0, -120.0, 0.0)
SPEED: Final = 0.2
INFEASIBLE_STATES: Final = 300
# The drift correction that `infeasible` asks for about every axis, and what it turns joint velocities down to [rad/s].
CORRECTION: Final = 0.5
SLOWEST: Final = 0.05


def limit_corner() -> Scenario:
    """Pull the tool to where elbow and sixth joint both meet their limits, on along them sideways, and back out.

    In the arm's plane the corner holds the tool altogether. Sideways, where the hand always pulls a little too, the
    tool is free, and must stay so.
    """
    robot = load_robot("lbr_med14")
    corner = np.deg2rad(CORNER_DEG)
    q0 = corner + np.deg2rad((0.0, -2.0, 0.0, 4.0, 0.0, 6.0, 0.0))
    inwards = robot.pose(corner)[:3, 3] - robot.pose(q0)[:3, 3]
    inwards /= np.linalg.norm(inwards)
    sideways = np.array([0.0, 1.0, 0.0])
    hand = strokes(
        pull(inwards + 0.3 * sideways, SPEED, 0.06),
        pull(inwards + sideways, SPEED, 0.06),
        pull(-inwards + 0.3 * sideways, SPEED, 0.03),
        rest(),
    )
    return Scenario(
        name="limit-corner",
        description="into two joint limits at once, along them, and back out; orientation fixed",
        robot=robot,
        q0=q0,
        dt=DEFAULT_DT,
        phases=(Phase(Mode.fix_orientation(), hand, hand.duration),),
        watched_joints=(3, 5),
    )


def start_outside_limits() -> Scenario:
    """Start with the elbow 3 deg and the sixth joint 2 deg beyond their limits; pull further out, then back in.

    What the arm was left at by other software, or limits that were narrowed while it was there. No joint may go
    further out, the arm must not be stuck, and the QP not become infeasible.
    """
    robot = load_robot("lbr_med14")
    q0 = np.deg2rad(CORNER_DEG) - np.deg2rad((0.0, 0.0, 0.0, 3.0, 0.0, 2.0, 0.0))
    inside = np.deg2rad((0.0, 85.0, 0.0, -115.0, 0.0, -110.0, 0.0))
    back = robot.pose(inside)[:3, 3] - robot.pose(q0)[:3, 3]
    sideways = np.array([0.0, 0.5 * np.linalg.norm(back), 0.0])
    hand = strokes(
        pull(sideways - back, SPEED, 0.04),
        pull(back, SPEED, 1.3 * float(np.linalg.norm(back))),
        rest(),
    )
    return Scenario(
        name="start-outside-limits",
        description="two joints beyond their limits: pulled further out, then back in; orientation fixed",
        robot=robot,
        q0=q0,
        dt=DEFAULT_DT,
        phases=(Phase(Mode.fix_orientation(), hand, hand.duration),),
        watched_joints=(3, 5),
    )


def infeasible() -> Scenario:
    """Ask for a drift correction that the joints are too slow for; the right answer is a certificate.

    The locked rows are to turn with `CORRECTION` about every axis while joint velocities are turned down to `SLOWEST`.
    A row that is the rotation about a unit axis has no entry above 1, so that seven joints make at most
    7 x 0.05 = 0.35 rad/s of the 0.5: no joint velocity within the limits exists, at any state. Both numbers are
    run-time inputs (`v_fixed`, `qd_max`) of every formulation that keeps limits and locked rows, whatever its
    variables and objective; a formulation without these inputs has no such block.

    The states are i.i.d., of a fixed seed: in closed loop every tick would be the same safe stop at the same place.
    """
    robot = load_robot("lbr_med14")
    rng = np.random.default_rng(20261125)
    mode = Mode.fix_orientation()
    share = rng.uniform(0.1, 0.9, size=(INFEASIBLE_STATES, robot.nv))
    v = rng.normal(size=(INFEASIBLE_STATES, mode.m_free))
    v *= rng.uniform(0.0, 0.25, size=(INFEASIBLE_STATES, 1)) / np.linalg.norm(v, axis=1, keepdims=True)
    states = States(
        mode=mode,
        q=robot.q_min + share * (robot.q_max - robot.q_min),
        qd_prev=rng.uniform(-SLOWEST, SLOWEST, size=(INFEASIBLE_STATES, robot.nv)),
        v=v,
    )
    return Scenario(
        name="infeasible",
        description="a drift correction that the joints are too slow for: the right answer is a certificate",
        robot=robot,
        q0=states.q[0],
        dt=DEFAULT_DT,
        states=states,
        expects=Status.PRIMAL_INFEASIBLE,
        inputs={"v_fixed": np.full(mode.m_fixed, CORRECTION), "qd_max": np.full(robot.nv, SLOWEST)},
    )
