"""
Arms as capsules: a few bounding volumes per arm, for keeping its links apart and away from obstacles.

A capsule is all points within its radius of a segment; a sphere is one whose segment has no length. Sources of the
sizes stand beside the tables. They are approximations of the housings without any tool or cable: a controller adds a
margin on top, and whoever mounts a tool adds its capsule.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from .errors import RobotError

if TYPE_CHECKING:
    from collections.abc import Mapping

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Capsule:
    """
    One bounding volume of an arm.

    Parameters
    ----------
    name
        For messages and row names; unique on its arm.
    link
        Number of the joint that moves it, counted from 1; 0 is the base.
    start, end
        Ends of its segment in the link's frame as in the URDF [m]; the same twice for a sphere.
    radius
        [m].
    """

    name: str
    link: int
    start: Point
    end: Point
    radius: float

    def __post_init__(self) -> None:
        if self.link < 0:
            raise RobotError(f"capsule {self.name!r}: expected a link of 0 (the base) or more, got {self.link}")
        for label, point in (("start", self.start), ("end", self.end)):
            if len(point) != 3 or not all(math.isfinite(value) for value in point):
                raise RobotError(f"capsule {self.name!r}: expected {label} as 3 finite numbers, got {point}")
        if not (math.isfinite(self.radius) and self.radius > 0.0):
            raise RobotError(f"capsule {self.name!r}: expected a positive radius, got {self.radius}")

    @property
    def is_sphere(self) -> bool:
        """Whether its segment has no length."""
        return self.start == self.end


@dataclass(frozen=True)
class CapsuleModel:
    """
    An arm's capsules and the pairs of them that can meet.

    Parameters
    ----------
    capsules
        Base first.
    pairs
        Names of the capsules to keep apart.
    """

    capsules: tuple[Capsule, ...]
    pairs: tuple[tuple[str, str], ...]


# KUKA's housings, after the collision cylinders of the mechanically alike iiwa 14 in Drake's iiwa_description
# (iiwa14_primitive_collision.urdf, BSD-3-Clause): each capsule has such a cylinder's axis, radius and overall length,
# its round ends in place of the flat ones; for the base, the capsule that the file itself gives for self-collision.
# The hand, a mesh there, is this project's estimate of wrist and flange. The smaller arm gets the larger one's radii.
_LBR: Final = (
    Capsule("base", 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.125), 0.15),
    Capsule("shoulder", 1, (0.0, -0.014, 0.096), (0.0, -0.014, 0.184), 0.101),
    Capsule("upper arm", 2, (0.0, 0.012, 0.035), (0.0, 0.1, 0.035), 0.101),
    Capsule("elbow", 3, (0.0, 0.025, 0.084), (0.0, 0.025, 0.19), 0.092),
    Capsule("forearm", 4, (0.0, 0.023, 0.025), (0.0, 0.089, 0.025), 0.092),
    # Leans by 0.3 rad from the axis of A5, with the cover of the wrist's drives.
    Capsule("wrist", 5, (0.0, 0.0078, 0.0584), (0.0, 0.0522, 0.2016), 0.07),
)
_LBR_MED14: Final = (*_LBR, Capsule("hand", 6, (0.0, 0.0, 0.0), (0.0, 0.096, 0.0), 0.08))
# A6 of the smaller arm has its frame beside the wrist's centre.
_LBR_MED7: Final = (*_LBR, Capsule("hand", 6, (0.0, 0.0, 0.0607), (0.0, 0.096, 0.0607), 0.08))

# Axes from the manufacturer's DH table and the offsets of upper arm and forearm along their joint axes, 0.138 and
# 0.007 m (Universal_Robots_ROS2_Description, config/ur5e/physical_parameters.yaml, BSD-3-Clause). Radii are rounded
# up from what holds the collision meshes of the UR5, the arm's predecessor of the same build, in the
# example-robot-data wheel: 0.1105, 0.0916, 0.0879, 0.0801, 0.0651, 0.0655, 0.0435 m. The UR5e's wrist 3 is 17 mm longer
# (d6 = 0.0996 m instead of 0.0823 m, for its force sensor), and so is the capsule around it.
_UR5E: Final = (
    Capsule("base", 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.115),
    Capsule("shoulder", 1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.095),
    Capsule("upper arm", 2, (0.0, 0.0, 0.138), (-0.425, 0.0, 0.138), 0.09),
    Capsule("forearm", 3, (0.0, 0.0, 0.007), (-0.3922, 0.0, 0.007), 0.082),
    Capsule("wrist 1", 4, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.068),
    Capsule("wrist 2", 5, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.068),
    Capsule("wrist 3", 6, (0.0, 0.0, -0.0346), (0.0, 0.0, -0.0173), 0.045),
)

# Which pairs: of 4,000 random states within the limits, those whose capsules came closer than 0.1 m, or less than that
# a mounted tool away; not those that a joint or two between them keep apart, nor those that touch in any state because
# the volumes are larger than the housings (base and upper arm; the UR5e's forearm and the wrists beyond it).
_LBR_PAIRS: Final = (
    *(("base", name) for name in ("elbow", "forearm", "wrist", "hand")),
    *(("shoulder", name) for name in ("wrist", "hand")),
    ("upper arm", "hand"),
)
_UR5E_WRISTS: Final = ("wrist 1", "wrist 2", "wrist 3")
_UR5E_PAIRS: Final = (
    *(("base", name) for name in ("forearm", *_UR5E_WRISTS)),
    *(("shoulder", name) for name in ("forearm", *_UR5E_WRISTS)),
    *(("upper arm", name) for name in _UR5E_WRISTS),
)

_MODELS: Final[Mapping[str, CapsuleModel]] = MappingProxyType(
    {
        "lbr_med14": CapsuleModel(_LBR_MED14, _LBR_PAIRS),
        "lbr_med7": CapsuleModel(_LBR_MED7, _LBR_PAIRS),
        "ur5e": CapsuleModel(_UR5E, _UR5E_PAIRS),
    }
)


def capsule_model(robot: str) -> CapsuleModel:
    """
    Return the capsules of an arm of this library.

    Parameters
    ----------
    robot
        Its registered name.

    Raises
    ------
    RobotError
        If the library has none for it.
    """
    if robot not in _MODELS:
        raise RobotError(
            f"capsules: expected one of {', '.join(sorted(_MODELS))}, got {robot!r}; give your own capsules"
        )
    return _MODELS[robot]
