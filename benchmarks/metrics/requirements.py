"""The ten requirements of the thesis (2.1) as ten measured numbers of a cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from ...control import FIXED_TOLERANCE
from ...solvers import Status
from .measures import (
    UNNOTICED,
    accuracy,
    breakaway,
    constraints,
    drift,
    singularities,
    sliding,
    smoothness,
    unexpected_motion,
    velocity_limits,
    workspace,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from .ticks import Ticks


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
    seen : bool
        Whether the threshold was set after values had been seen.
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
    seen: bool = False

    def passes(self, value: float) -> bool:
        """Whether a value is good enough."""
        return value >= self.threshold if self.at_least else value <= self.threshold


REQUIREMENTS: Final = (
    Requirement(
        1, "accuracy", "Absolute positional accuracy of the robot (0.5 mm, 0.25 deg)",
        "drift of what the mode locks: the tool's largest distance from it since the mode began, over 0.5 mm, or its "
        "largest turn over 0.25 deg, whichever is more, times a minute over the time that the hand has pulled: the "
        "share of the accuracy that a controller without drift compensation uses up in a minute that goes on as the "
        "run did. The arm's own accuracy is its calibration's and its sensors' and can't be measured from a sweep",
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
        "one minus the share of the hand's velocity that the tool is short of along it, of what the command of least "
        "Cartesian error within limits and locked rows makes at the same state; mean of every tenth tick at which the "
        "hand pulls. Which part of the workspace another way might have led to, it can't tell",
        "-", UNNOTICED, workspace, at_least=True, stand_in=True,
    ),
    Requirement(
        4, "sliding", 'Possibility to "slide along" joint limit (the robot must never freeze all the joints at once)',
        "of every tenth tick, those at which a joint is within 1e-3 rad of a limit and the command of least error "
        "would move the tool by 1 mm/s or more: the share at which no joint has been faster than 1e-3 "
        "of its velocity limit for 0.05 s",
        "-", 0.0, sliding, seen=True,
    ),
    Requirement(
        5, "singularities", "Avoid (computationally) unnecessary singularities",
        "where the smallest singular value of the guided rows is below 0.1: largest joint acceleration over its limit, "
        "switches of mode aside, or the mean share of the hand's velocity that the tool is short of, as in 3, over a "
        "half, of ticks at which the command of least error takes no joint faster than the tool's way over 0.1 m; "
        "whichever is more. A singularity that neither jerks the arm nor holds it is none to the user",
        "-", 1.001, singularities, seen=True,
    ),
    Requirement(
        6, "breakaway", "No noticeable breakaway force/torque",
        "dead zone: largest velocity asked for of which the tool makes less than a hundredth, away from limits and "
        "singularities; times the admittance's damping it is a force (at 50 N s/m, 1 mm/s is 0.05 N). Friction and "
        "sensors are not in a sweep",
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
        "switches of mode aside; a joint that passes its limit counts with what stopping it there at once takes",
        "-", 1.001, smoothness,
    ),
    Requirement(
        10, "unexpected", "No unexpected motion of the robot",
        "ticks at which the tool moves against the hand (v . (v + eps) < 0), plus, per second and switches of mode "
        "aside: ticks at which a joint's velocity changes by more than twice what its acceleration limit allows, and "
        "sign changes of accelerations above 1 % of it",
        "ticks, 1/s", 0.99, unexpected_motion, seen=True,
    ),
)  # fmt: skip


def requirement_values(ticks: Ticks) -> dict[str, float | None]:
    """Measure all ten by their keys; all None where the scenario's right answer is a certificate."""
    expected = ticks.scenario.expects is Status.SOLVED
    return {each.key: each.measure(ticks) if expected else None for each in REQUIREMENTS}
