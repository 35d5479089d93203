"""`obstacles`: capsules of the arm that stay away from spheres and capsules in the world."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np

from ...robots import Capsule, RobotError, capsule_model
from ..algebra import dot, matmul
from .closest_points import Segment, closest_points, direction
from .gaps import GapConstraint, Gaps
from .self_collision import check_capsules, segment_of

if TYPE_CHECKING:
    from ..tick import Tick

# Where an obstacle is until a controller says where it is [m].
_FAR: tuple[float, float, float] = (0.0, 0.0, 100.0)


@dataclass(frozen=True)
class Obstacle:
    """A sphere or capsule in the world, whose place and size are run-time parameters.

    Parameters
    ----------
    name : str
        Letters, digits and underscores.
    start, end : tuple of 3 float
        Defaults of the ends of its segment in the world [m]; no `end` for a sphere.
    radius : float
        Default [m].
    """

    name: str
    start: tuple[float, float, float] = _FAR
    end: tuple[float, float, float] | None = None
    radius: float = 0.05

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.name):
            raise ValueError(f"obstacle: expected a name of letters, digits and underscores, got {self.name!r}")
        for label, point in (("start", self.start), ("end", self.end)):
            if point is not None and not (np.shape(point) == (3,) and np.all(np.isfinite(point))):
                raise ValueError(f"obstacle {self.name}: expected {label} as 3 finite numbers, got {point}")
        if not (np.isfinite(self.radius) and self.radius >= 0.0):
            raise ValueError(f"obstacle {self.name}: expected a radius of 0 or more, got {self.radius}")


@dataclass(frozen=True, kw_only=True)
class Obstacles(GapConstraint):
    """Distance of the arm's capsules from obstacles in the world, kept above a margin.

    The rule is that of `SelfCollision`, with an obstacle that stands still in place of the second link; what is said
    there of nearly parallel segments holds here too. An obstacle that moves is where its parameters say it is at each
    tick: the arm does not evade it while the hand is at rest.

    Parameters
    ----------
    obstacles : sequence of Obstacle
        Empty: `spheres` spheres and `bars` capsules far away, called sphere1, ..., bar1, ...
    spheres, bars : int
        How many, where `obstacles` is empty.
    capsules : sequence of Capsule
        The arm's. Empty: the ready-made ones of the robot, but for those of its base, which no command moves.

    Run-time parameters
    -------------------
    <name>_margin
        Distance to keep between the surfaces, 0.02 unless told otherwise [m]; may be negative.
    <name>_<obstacle>_start, <name>_<obstacle>_end (of a capsule) : shape (3,)
        World [m].
    <name>_<obstacle>_radius
        [m].
    """

    obstacles: tuple[Obstacle, ...] = ()
    spheres: int = 1
    bars: int = 0
    capsules: tuple[Capsule, ...] = ()

    kind: ClassVar[str] = "obstacles"
    unit: ClassVar[str] = "m"
    default_deceleration: ClassVar[float] = 2.0
    default_gain: ClassVar[float] = 10.0
    default_retreat: ClassVar[float] = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        for label, count in (("spheres", self.spheres), ("bars", self.bars)):
            if isinstance(count, bool) or not isinstance(count, int) or count < 0:
                raise ValueError(f"{self.name}, {label}: expected a number of 0 or more, got {count!r}")
        made = tuple(self.obstacles) or (
            *(Obstacle(f"sphere{i + 1}") for i in range(self.spheres)),
            *(Obstacle(f"bar{i + 1}", end=_FAR) for i in range(self.bars)),
        )
        names = [obstacle.name for obstacle in made]
        if not made or len(set(names)) < len(names):
            raise ValueError(f"{self.name}: expected one obstacle or more, of different names, got {names}")
        object.__setattr__(self, "obstacles", made)
        object.__setattr__(self, "capsules", tuple(self.capsules))
        check_capsules(self.name, self.capsules)
        if self.capsules and not any(capsule.link for capsule in self.capsules):
            raise RobotError(f"{self.name}, capsules: expected one on a moving link, got only some on the base")

    def gaps(self, tick: Tick) -> Gaps:
        """Measure the distance of every capsule from every obstacle, obstacle by obstacle."""
        capsules = [c for c in self.capsules or capsule_model(tick.robot.name).capsules if c.link]
        margin = self.parameter(tick, "margin", 0.02, unit="m")
        own = [segment_of(tick, capsule) for capsule in capsules]
        gaps: list[ca.SX] = []
        rows: list[ca.SX] = []
        for obstacle in self.obstacles:
            other, radius = self._place(tick, obstacle)
            for capsule, segment in zip(capsules, own, strict=True):
                P, Q = closest_points(segment, other)
                n = direction(P, Q, segment.along, other.along)
                gaps.append(ca.sqrt(dot(P - Q, P - Q)) - (capsule.radius + radius) - margin)
                rows.append(matmul(n.T, tick.kinematics.point_jacobian(capsule.link, P)))
        return Gaps(ca.vertcat(*gaps), ca.sparsify(ca.vertcat(*rows)), ca.SX.ones(len(gaps), 1))

    def _place(self, tick: Tick, obstacle: Obstacle) -> tuple[Segment, ca.SX]:
        radius = self.parameter(tick, f"{obstacle.name}_radius", obstacle.radius, unit="m", not_negative=True)
        start = self.parameter(tick, f"{obstacle.name}_start", obstacle.start, size=3, unit="m")
        if obstacle.end is None:
            return Segment(start, None), radius
        end = self.parameter(tick, f"{obstacle.name}_end", obstacle.end, size=3, unit="m")
        return Segment(start, end - start), radius
