"""`self-collision`: capsules of the arm that stay apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca

from ...robots import Capsule, RobotError, capsule_model
from ..algebra import dot, matmul
from .closest_points import Segment, closest_points, direction
from .gaps import GapConstraint, Gaps

if TYPE_CHECKING:
    from ...robots import Robot
    from ..tick import Tick

# Capsules on links this far apart along the chain are checked, where pairs are not given: neighbours always touch.
_NEIGHBOURS = 2


@dataclass(frozen=True, kw_only=True)
class SelfCollision(GapConstraint):
    r"""Distance of capsules of the arm, kept above a margin.

    .. math:: n_{ij}'(J_i - J_j)\,\dot q \ge -b(d_{ij} - r_i - r_j - margin)

    with :math:`d_{ij}` the distance of the capsules' segments, :math:`n_{ij}` the unit vector from the closest point
    of j to that of i, and :math:`J_i, J_j` the Jacobians of the two points, each carried by its link. This is the
    rule of the shared-control drilling robot ("Inequality Constraints"), with b its step bound, a velocity damper, or
    the viable bound: see `GapConstraint`, which also says what happens below the margin and what a linear row misses.

    A row holds at one point of each pair. Where segments are nearly parallel that point jumps from one end to the
    other, the gap may be missed by what the other end moves in a period, and the command can jump as well. Within one
    period the arm must not pass through a capsule, or the direction is that of the far side.

    Parameters
    ----------
    capsules : sequence of Capsule
        Empty: the ready-made ones of the robot, `kinqp.robots.capsule_model`.
    pairs : sequence of two names
        Which capsules to keep apart. Empty: those of the ready-made model, or, of given capsules, all pairs but those
        of one link and of neighbouring links.

    Run-time parameters
    -------------------
    <name>_margin
        Distance to keep between the surfaces, 0.02 unless told otherwise [m]; may be negative.
    """

    capsules: tuple[Capsule, ...] = ()
    pairs: tuple[tuple[str, str], ...] = ()

    kind: ClassVar[str] = "self-collision"
    unit: ClassVar[str] = "m"
    default_deceleration: ClassVar[float] = 2.0
    default_gain: ClassVar[float] = 10.0
    default_retreat: ClassVar[float] = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "capsules", tuple(self.capsules))
        object.__setattr__(self, "pairs", tuple((first, second) for first, second in self.pairs))
        check_capsules(self.name, self.capsules)

    def checked_pairs(self, robot: Robot) -> tuple[tuple[Capsule, Capsule], ...]:
        """Give the pairs that are kept apart on a robot, in the order of the rows.

        Raises
        ------
        RobotError
            When the robot has no ready-made capsules and none are given, or a pair names a capsule that does not exist.
        """
        model = None if self.capsules else capsule_model(robot.name)
        capsules = self.capsules if model is None else model.capsules
        named = {capsule.name: capsule for capsule in capsules}
        wanted = self.pairs or (() if model is None else model.pairs)
        if not wanted:
            return tuple(
                (first, second) if first.link <= second.link else (second, first)
                for i, first in enumerate(capsules)
                for second in capsules[i + 1 :]
                if abs(first.link - second.link) >= _NEIGHBOURS
            )
        for name in (name for pair in wanted for name in pair):
            if name not in named:
                raise RobotError(f"{self.name}, pairs: expected capsules among {', '.join(named)}, got {name!r}")
        ordered = [sorted((named[first], named[second]), key=lambda capsule: capsule.link) for first, second in wanted]
        for first, second in ordered:
            if first.link == second.link:
                raise RobotError(
                    f"{self.name}, pairs: expected capsules of two links, got {first.name!r} and {second.name!r}"
                )
        return tuple((first, second) for first, second in ordered)

    def gaps(self, tick: Tick) -> Gaps:
        """Measure the distance of every pair."""
        pairs = self.checked_pairs(tick.robot)
        margin = self.parameter(tick, "margin", 0.02, unit="m")
        measured = [_pair(tick, first, second) for first, second in pairs]
        return Gaps(
            ca.vertcat(*(gap for gap, _ in measured)) - margin,
            ca.vertcat(*(row for _, row in measured)),
            ca.SX.ones(len(pairs), 1),
        )


def check_capsules(owner: str, capsules: tuple[Capsule, ...]) -> None:
    """Raise a RobotError unless the names differ."""
    names = [capsule.name for capsule in capsules]
    if len(set(names)) < len(names):
        raise RobotError(f"{owner}, capsules: expected different names, got {', '.join(names)}")


def segment_of(tick: Tick, capsule: Capsule) -> Segment:
    """Where a capsule's segment is in the world.

    Raises
    ------
    RobotError
        When the robot has no such link.
    """
    start = tick.kinematics.point_on_link(capsule.link, capsule.start)
    if capsule.is_sphere:
        return Segment(start, None)
    return Segment(start, tick.kinematics.point_on_link(capsule.link, capsule.end) - start)


def _pair(tick: Tick, first: Capsule, second: Capsule) -> tuple[ca.SX, ca.SX]:
    """Distance of two surfaces and its row, shapes (1, 1) and (1, nv); the first is on the lower link."""
    a, b = segment_of(tick, first), segment_of(tick, second)
    P, Q = closest_points(a, b)
    n = direction(P, Q, a.along, b.along)
    row = -matmul(n.T, tick.kinematics.point_jacobian(second.link, Q))
    # Joints that carry both leave their distance alone: exactly, not up to rounding.
    row[0, : first.link] = 0
    return ca.sqrt(dot(P - Q, P - Q)) - (first.radius + second.radius), ca.sparsify(row)
