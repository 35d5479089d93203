"""How the ten requirements of the thesis (2.1) are measured, one function each; None where there is nothing to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ...solvers import Status
from .against import against
from .motion import JUMP_SHARE, ON_LIMIT, beyond, sign_changes
from .ticks import PULLING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .ticks import Ticks

# Required accuracy (thesis 2.1): 0.5 mm and 0.25 deg [m; rad].
ACCURACY: Final = (0.5e-3, float(np.deg2rad(0.25)))
# How long the accuracy is to last [s]: a bout of pushing, after which a mode is engaged anew.
LASTING: Final = 60.0
# Within this of a limit a joint is at it, for what the hand feels [rad or m].
AT_LIMIT: Final = 1e-3
# Within this of a limit a joint approaches it [rad or m]: more than what braking from 1.4 rad/s takes at 10 rad/s^2.
NEAR_LIMIT: Final = 0.1
# Joints slower than this share of `qd_max` stand still, for what the hand feels.
STILL: Final = 1e-3
# They freeze when they have stood still for so long while the hand pulls [s]; starting and turning back take less.
FREEZING: Final = 0.05
# Of the force that a hand pulls with, people tell 7 % more from as much (Pang, Tan and Durlach, Perception &
# Psychophysics 49, 1991). Under an admittance a tool that makes a share s of what is asked takes 1/s of the force.
UNNOTICED: Final = 1.0 / 1.07
# Singular values of the guided rows below which an arm is near a singularity; a motion is easy that needs no joint
# faster than the tool is over this [m or rad per rad].
NEAR_SINGULAR: Final = 0.1
# Losing more than this share of an easy motion is being stuck.
STUCK: Final = 0.5
# A tool that makes less than this share of what is asked does not respond.
RESPONSE: Final = 0.01
# So long after the hand has come to rest nothing may still follow it [s]: ten time constants of the slowest.
SETTLED: Final = 0.2
# Share of a velocity limit from which on it counts as reached, and what it may be exceeded by [rad/s or m/s].
AT_SPEED: Final = 0.999
SPEED_TOLERANCE: Final = 1e-8


def accuracy(ticks: Ticks) -> float | None:
    """How much of the accuracy the controller uses up in a minute of pulling that goes on as the run did."""
    if not ticks.closed_loop or np.any(ticks.scenario.inputs.get("v_fixed", 0.0)):
        return None
    used = np.maximum(ticks.locked.offset / ACCURACY[0], ticks.locked.turn / ACCURACY[1])
    shares = []
    for phase in np.unique(ticks.phase):
        here = ticks.phase == phase
        pulled = float(np.sum(ticks.pulling[here])) * ticks.scenario.dt
        if ticks.mode(int(phase)).m_fixed and pulled > 0.0:
            shares.append(float(np.max(used[here])) * LASTING / pulled)
    return max(shares) if shares else None


def constraints(ticks: Ticks) -> float | None:
    """How far the locked rows are off."""
    if not any(mode.m_fixed for mode in ticks.scenario.modes):
        return None
    return float(np.max(ticks.locked.relative))


def workspace(ticks: Ticks) -> float | None:
    """How much of what could be made of the hand's motion is made."""
    if not (ticks.closed_loop and len(ticks.possible.tick)):
        return None
    return float(np.mean(1.0 - ticks.possible.lost))


def sliding(ticks: Ticks) -> float | None:
    """How often all joints freeze at a limit although they need not."""
    if not ticks.closed_loop:
        return None
    asked, limit = ticks.possible.tick, ticks.limit("qd_max")
    held = asked[np.any(ticks.distance[asked] < AT_LIMIT, axis=1) & (ticks.possible.moved > PULLING)]
    if not held.size:
        return None
    still = ticks.pulling & (np.max(np.abs(ticks.qd) / limit, axis=1) < STILL)
    number = np.arange(len(still))
    standing = number - np.maximum.accumulate(np.where(still, -1, number))
    return float(np.mean(standing[held] * ticks.scenario.dt >= FREEZING))


def singularities(ticks: Ticks) -> float | None:
    """Peak acceleration near singularities, or how much of an easy motion is lost there."""
    near = (ticks.column("sigma_min") < NEAR_SINGULAR) & ~ticks.switched
    if not (ticks.closed_loop and near.any()):
        return None
    lost = ticks.possible.lost[_easy(ticks) & near[ticks.possible.tick]]
    held = float(np.mean(lost)) / STUCK if lost.size else 0.0
    return max(float(np.max(np.abs(ticks.acceleration[near]))), held)


def breakaway(ticks: Ticks) -> float | None:
    """How hard the hand pulls before the tool moves."""
    asked, made = (np.linalg.norm(rows, axis=1) for rows in (ticks.v, ticks.v + ticks.eps))
    unhindered = np.all(ticks.distance > AT_LIMIT, axis=1) & (ticks.column("sigma_min") > NEAR_SINGULAR)
    unhindered &= asked > 0.0
    if not (ticks.closed_loop and np.any(unhindered & ticks.pulling)):
        return None
    return float(np.max(asked[unhindered & (made < RESPONSE * asked)], initial=0.0))


def drift(ticks: Ticks) -> float | None:
    """How fast joints move with the hand at rest."""
    if not ticks.closed_loop:
        return None
    resting = ~np.any(ticks.v, axis=1)
    ticks_needed = round(SETTLED / ticks.scenario.dt)
    number = np.arange(len(resting))
    last_pull = np.maximum.accumulate(np.where(resting, -1, number))
    settled = resting & (number - last_pull > ticks_needed) & (last_pull >= 0)
    return float(np.max(np.abs(ticks.qd[settled]))) if settled.any() else None


def velocity_limits(ticks: Ticks) -> float | None:
    """How often a velocity limit that is reached is broken or stops the arm."""
    if not ticks.closed_loop:
        return None
    limit = ticks.limit("qd_max")
    fastest = np.maximum(np.abs(ticks.qd), np.abs(ticks.qd_before))
    reached = np.any(fastest >= AT_SPEED * limit, axis=1)
    if not reached.any():
        return None
    wrong = np.any(np.abs(ticks.qd) > limit + SPEED_TOLERANCE, axis=1) | (ticks.words("status") != Status.SOLVED.value)
    return float(np.mean(wrong[reached]))


def smoothness(ticks: Ticks) -> float | None:
    """Peak deceleration towards a limit, and what stopping it there at once would be of a joint that passes it."""
    if not ticks.closed_loop:
        return None
    # +1 where the upper limit is the nearer one.
    side = np.where(ticks.limit("q_max") - ticks.q < ticks.q - ticks.limit("q_min"), 1.0, -1.0)
    approach = (ticks.distance < NEAR_LIMIT) & (side * ticks.qd_before > 0.0) & ~ticks.switched[:, None]
    if not approach.any():
        return None
    braking = float(np.max(-side[approach] * ticks.acceleration[approach], initial=0.0))
    # The arm's own stop is hard: from the speed of the command to rest in one period.
    passing = beyond(ticks.q_next, ticks.limit("q_min"), ticks.limit("q_max")) > ON_LIMIT
    passing &= side * ticks.qd > SPEED_TOLERANCE
    stopping = (np.abs(ticks.qd) / ticks.scenario.dt / ticks.limit("qdd_max"))[passing]
    return max(braking, float(np.max(stopping, initial=0.0)))


def unexpected_motion(ticks: Ticks) -> float | None:
    """How often the motion is abrupt or wavers, or goes against the hand."""
    if not ticks.closed_loop:
        return None
    acceleration = np.where(ticks.switched[:, None], 0.0, ticks.acceleration)
    abrupt = np.sum(np.any(np.abs(acceleration) > JUMP_SHARE, axis=1))
    back, _ = against(ticks)
    return float((abrupt + sign_changes(acceleration)) / ticks.scenario.duration + np.sum(back))


def _easy(ticks: Ticks) -> NDArray[np.bool_]:
    """Those of the ticks asked whose best command needs no joint that is fast for what the tool does, shape (N,)."""
    fastest = np.max(np.abs(ticks.possible.qd), axis=1, initial=0.0)
    flags: NDArray[np.bool_] = NEAR_SINGULAR * fastest <= ticks.possible.moved
    return flags
