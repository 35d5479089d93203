"""The ten requirements of the thesis (2.1) as ten measured numbers of a cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from ...control import FIXED_TOLERANCE
from ...solvers import Status
from .motion import JUMP_SHARE, sign_changes

if TYPE_CHECKING:
    from collections.abc import Callable

    from .ticks import Ticks

# Required accuracy (thesis 2.1): 0.5 mm and 0.25 deg [m; rad].
ACCURACY: Final = (0.5e-3, float(np.deg2rad(0.25)))
# Within this of a limit a joint is at it, for what the hand feels [rad or m].
AT_LIMIT: Final = 1e-3
# Within this of a limit a joint approaches it [rad or m]: more than what braking from 1.4 rad/s takes at 10 rad/s^2.
NEAR_LIMIT: Final = 0.1
# Joints slower than this share of `qd_max` stand still, for what the hand feels.
STILL: Final = 1e-3
# No joint faster than this has moved at all [rad/s or m/s].
NOT_MOVING: Final = 1e-6
# Singular values of the guided rows below which an arm is near a singularity [m or rad].
NEAR_SINGULAR: Final = 0.1
# So long after the hand has come to rest nothing may still follow it [s]: ten time constants of the slowest.
SETTLED: Final = 0.2
# Share of a velocity limit from which on it counts as reached, and what it may be exceeded by [rad/s or m/s].
AT_SPEED: Final = 0.999
SPEED_TOLERANCE: Final = 1e-8


@dataclass(frozen=True)
class Requirement:
    """A requirement and how it is measured.

    Attributes
    ----------
    number : int
        In the thesis's list.
    key : str
        Column of the records (`requirement_KEY`) and of the scorecard.
    text : str
        The thesis's words.
    definition : str
        Of the number.
    unit : str
    threshold : float
        Where it passes: up to here, or from here on where `at_least`.
    measure : callable
        From a cell's ticks; None where they hold nothing to measure it on.
    at_least : bool
    stand_in : bool
        Whether the requirement itself can't be measured from a sweep, and this is the closest that can.
    """

    number: int
    key: str
    text: str
    definition: str
    unit: str
    threshold: float
    measure: Callable[[Ticks], float | None]
    at_least: bool = False
    stand_in: bool = False

    def passes(self, value: float) -> bool:
        """Whether a value is good enough."""
        return value >= self.threshold if self.at_least else value <= self.threshold


def accuracy(ticks: Ticks) -> float | None:
    """How much of the accuracy the controller uses up."""
    if not ticks.closed_loop or np.any(ticks.scenario.inputs.get("v_fixed", 0.0)):
        return None
    if not any(mode.m_fixed for mode in ticks.scenario.modes):
        return None
    return float(max(np.max(ticks.locked.offset) / ACCURACY[0], np.max(ticks.locked.turn) / ACCURACY[1]))


def constraints(ticks: Ticks) -> float | None:
    """How far the locked rows are off."""
    if not any(mode.m_fixed for mode in ticks.scenario.modes):
        return None
    return float(np.max(ticks.locked.relative))


def workspace(ticks: Ticks) -> float | None:
    """How much of the hand's motion is made."""
    if not ticks.closed_loop:
        return None
    scale = ticks.column("task_scale")[ticks.pulling]
    scale = scale[np.isfinite(scale)]
    return float(np.mean(np.clip(scale, 0.0, 1.0))) if scale.size else None


def sliding(ticks: Ticks) -> float | None:
    """How often all joints freeze at a limit."""
    held = ticks.pulling & np.any(ticks.distance < AT_LIMIT, axis=1)
    if not (ticks.closed_loop and held.any()):
        return None
    still = np.max(np.abs(ticks.qd) / ticks.limit("qd_max"), axis=1) < STILL
    return float(np.mean(still[held]))


def singularities(ticks: Ticks) -> float | None:
    """Peak acceleration near singularities."""
    near = (ticks.column("sigma_min") < NEAR_SINGULAR) & ~ticks.switched
    if not (ticks.closed_loop and near.any()):
        return None
    return float(np.max(np.abs(ticks.acceleration[near])))


def breakaway(ticks: Ticks) -> float | None:
    """How hard the hand pulls before anything moves."""
    unhindered = np.all(ticks.distance > AT_LIMIT, axis=1) & (ticks.column("sigma_min") > NEAR_SINGULAR)
    if not (ticks.closed_loop and np.any(unhindered & ticks.pulling)):
        return None
    still = unhindered & np.all(np.abs(ticks.qd) < NOT_MOVING, axis=1)
    asked = np.maximum(np.linalg.norm(ticks.v[:, :3], axis=1), np.linalg.norm(ticks.v[:, 3:], axis=1))
    return float(np.max(asked[still], initial=0.0))


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
    """Peak deceleration towards a limit."""
    if not ticks.closed_loop:
        return None
    # +1 where the upper limit is the nearer one.
    side = np.where(ticks.limit("q_max") - ticks.q < ticks.q - ticks.limit("q_min"), 1.0, -1.0)
    approach = (ticks.distance < NEAR_LIMIT) & (side * ticks.qd_before > 0.0) & ~ticks.switched[:, None]
    return float(np.max(-side[approach] * ticks.acceleration[approach], initial=0.0)) if approach.any() else None


def unexpected_motion(ticks: Ticks) -> float | None:
    """How often the motion is abrupt or wavers."""
    if not ticks.closed_loop:
        return None
    acceleration = np.where(ticks.switched[:, None], 0.0, ticks.acceleration)
    abrupt = np.sum(np.any(np.abs(acceleration) > JUMP_SHARE, axis=1))
    return float((abrupt + sign_changes(acceleration)) / ticks.scenario.duration)


REQUIREMENTS: Final = (
    Requirement(
        1, "accuracy", "Absolute positional accuracy of the robot (0.5 mm, 0.25 deg)",
        "largest distance of the tool from what its mode locks, since the mode began, over 0.5 mm, or its largest turn "
        "over 0.25 deg, whichever is more: the share of the accuracy that control uses up. The arm's own accuracy is "
        "its calibration's and its sensors' and can't be measured from a sweep",
        "-", 1.0, accuracy, stand_in=True,
    ),
    Requirement(
        2, "constraints", "Cartesian kinematics constraints",
        "largest error of a locked row of a command that was sent, safe stops included, over the joint speeds' share "
        "in that row where it exceeds 1",
        "m/s, rad/s", FIXED_TOLERANCE, constraints,
    ),
    Requirement(
        3, "workspace", "The workspace should be restricted as little as possible",
        "mean share of the hand's velocity that is made, over ticks at which it pulls; in the scorecard over that of "
        "the best of the cells on the same scenario, as some of it is lost to any controller",
        "-", 0.95, workspace, at_least=True, stand_in=True,
    ),
    Requirement(
        4, "sliding", 'Possibility to "slide along" joint limit (the robot must never freeze all the joints at once)',
        "of the ticks at which the hand pulls and a joint is within 1e-3 rad of a limit, the share at which no joint "
        "is faster than 1e-3 of its velocity limit; turning back takes a few",
        "-", 0.05, sliding,
    ),
    Requirement(
        5, "singularities", "Avoid (computationally) unnecessary singularities",
        "largest joint acceleration over its limit while the smallest singular value of the guided rows is below 0.1, "
        "switches of mode aside: a singularity that causes no peak is none to the user. Which ones the arm might have "
        "gone around, a sweep can't tell",
        "-", 1.001, singularities, stand_in=True,
    ),
    Requirement(
        6, "breakaway", "No noticeable breakaway force/torque",
        "largest velocity asked for at which no joint moves (1e-6 rad/s), away from limits and singularities; times "
        "the admittance's damping it is a force. Friction and sensors are not in a sweep",
        "m/s, rad/s", 1e-3, breakaway, stand_in=True,
    ),
    Requirement(
        7, "drift", "No drift",
        "largest joint velocity once the hand has rested for 0.2 s",
        "rad/s", 1e-3, drift,
    ),
    Requirement(
        8, "velocity_limits", "Adjustable joint velocity limits (without safety stop)",
        "of the ticks at or after which a joint is at its velocity limit, the share that exceeds it or ends in the "
        "safe stop",
        "-", 0.0, velocity_limits,
    ),
    Requirement(
        9, "smoothness", "Smooth behaviour in the joint limits",
        "largest deceleration over its limit of a joint that moves towards a position limit less than 0.1 rad away, "
        "switches of mode aside",
        "-", 1.001, smoothness,
    ),
    Requirement(
        10, "unexpected", "No unexpected motion of the robot",
        "ticks at which a joint's velocity changes by more than twice what its acceleration limit allows, plus sign "
        "changes of accelerations above 1 % of it, per second, switches of mode aside",
        "1/s", 1.0, unexpected_motion,
    ),
)  # fmt: skip


def requirement_values(ticks: Ticks) -> dict[str, float | None]:
    """Measure all ten by their keys; all None where the scenario's right answer is a certificate."""
    expected = ticks.scenario.expects is Status.SOLVED
    return {each.key: each.measure(ticks) if expected else None for each in REQUIREMENTS}
