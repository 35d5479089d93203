"""`drilling`: a UR5e with a drill, led to the entry, turned about it, and pushed in along a line.

The arm, its tool and its capsules are here for others who drill with it (`examples/drilling.py`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from ...formulations import DEFAULT_DT, Mode
from ...formulations.constraints import SelfCollision
from ...robots import Capsule, Robot, capsule_model, load_robot, with_tool
from .base import Phase, Scenario
from .strokes import Stroke, rest, strokes

# From the flange to the tip, along the flange's z [m].
DRILL_LENGTH: Final = 0.16
# From the tip back to the entry when the drill is turned about it [m].
INSERTED: Final = 0.06
# Elbow up, the drill pointing down and outwards, its tip 0.2 m above the plane of the base [deg].
START_DEG: Final = (20.0, -80.0, 100.0, -100.0, -80.0, 20.0)
# Joint windows of such a cell, as set up in the arm's safety configuration [deg]: elbow up, wrist 2 off its singularity
# at zero, and for wrist 3 what the drill's cable allows.
LOWEST_DEG: Final = (-60.0, -150.0, 40.0, -170.0, -150.0, -30.0)
HIGHEST_DEG: Final = (60.0, -30.0, 155.0, -60.0, -40.0, 30.0)

# A hand-held surgical drill's motor, and its bit. Sizes are this project's; the bit counts, so that it is kept off too.
DRILL: Final = (
    Capsule("drill", 6, (0.0, 0.0, 0.02), (0.0, 0.0, 0.09), 0.035),
    Capsule("bit", 6, (0.0, 0.0, 0.09), (0.0, 0.0, DRILL_LENGTH), 0.005),
)


def drilling_robot() -> Robot:
    """Make the arm of the shared-control drilling robot: a UR5e whose tool centre point is the tip of a drill."""
    robot = with_tool(load_robot("ur5e"), "ur5e_drill", (0.0, 0.0, DRILL_LENGTH), tip="drill_tip")
    return replace(robot, q_min=np.deg2rad(LOWEST_DEG), q_max=np.deg2rad(HIGHEST_DEG))


def drill_self_collision(**options: str | bool) -> SelfCollision:
    """Make the constraint that keeps arm and drill apart: the UR5e's capsules and pairs, and the drill against them.

    Parameters
    ----------
    **options
        Of `SelfCollision`: `approach`, `retreat`.
    """
    model = capsule_model("ur5e")
    links = ("base", "shoulder", "upper arm", "forearm")
    pairs = (*model.pairs, *((link, part.name) for part in DRILL for link in links))
    return SelfCollision(capsules=(*model.capsules, *DRILL), pairs=pairs, **options)  # type: ignore[arg-type]  # each option has its own type


def drilling() -> Scenario:
    """Lead the drill to the entry, turn it about the entry, and drill 1.5 cm, the hand never quite on the line.

    The three phases of the shared-control drilling robot's modes ("Equality Constraints"): orientation fixed, a
    software remote centre of motion, a straight line. While turning, the roll meets the limit of wrist 3, and sideways
    pulls in the last phase must not show in the hole. The hand rests wherever the mode changes.
    """
    robot = drilling_robot()
    lead = strokes(Stroke((0.15, -0.06, -0.05, 0.2, 0.0, -0.2), 0.3))
    turn = strokes(
        Stroke((0.0, 0.05, 0.0, 0.5, 0.3, 1.4), 0.3, "tool"),
        Stroke((0.0, 0.0, 0.0, -0.2, 0.3, -0.6), 0.3, "tool"),
    )
    drill = strokes(Stroke((0.04, -0.04, 0.1, 0.2, -0.3, 0.5), 0.3, "tool"), rest())
    return Scenario(
        name="drilling",
        description="led to the entry, turned about it, pushed in along a line; UR5e with a drill",
        robot=robot,
        q0=np.deg2rad(START_DEG),
        dt=DEFAULT_DT,
        phases=(
            Phase(Mode.fix_orientation(), lead, lead.duration),
            Phase(Mode.rcm(-INSERTED), turn, turn.duration),
            Phase(Mode.line("z"), drill, drill.duration),
        ),
        watched_joints=(5,),
    )
