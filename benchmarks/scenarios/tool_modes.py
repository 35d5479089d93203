"""`drill-line`, `rcm-pivot`, `mode-switch`: the tool held on a line, at a pivot, and through a surgeon's workflow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ...formulations import DEFAULT_DT, Mode
from ...robots import load_robot
from .base import Phase, Scenario
from .strokes import Stroke, rest, strokes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

# Tool pointing down, 0.5 m above the base's plane, in front of the arm.
ABOVE_TABLE_DEG: Final = (0.0, 30.0, 0.0, -70.0, 0.0, 80.0, 0.0)
# A tilted tool on the UR5e, elbow up.
DRILL_DEG: Final = (20.0, -80.0, 100.0, -100.0, -80.0, 10.0)
# From the tool centre point, which has passed it, back to the pivot along the tool's z [m].
PIVOT: Final = -0.08
# What joint velocities are turned down to beside a patient, by joint [rad/s].
CAREFUL: Final = 0.25


def drill_line() -> Scenario:
    """Drill 2 cm along the tool's z with a UR5e and pull back, the hand pushing sideways and twisting all the while.

    The arm of the shared-control drilling robot. The locked rows are all but one: what the hand does sideways must not
    show in the hole. The tilted wrist makes the line oblique to all axes.
    """
    sideways = (0.05, -0.05, 0.05, 0.2, -0.3, 0.5)
    back = (-0.05, 0.05, -0.05, -0.3, 0.2, -0.5)
    hand = strokes(Stroke(sideways, 0.55, "tool"), Stroke(back, 0.55, "tool"), rest())
    return _scenario(
        "drill-line", "along the tool's z and back, all else locked, the hand pushing sideways; UR5e", DRILL_DEG,
        Phase(Mode.line("z"), hand, hand.duration), robot="ur5e",
    )  # fmt: skip


def rcm_pivot() -> Scenario:
    """Turn a tool that has passed a trocar about it, one way, another and back, and pull it out by 1.6 cm.

    The pivot is a point of the tool. Drawing the tool back takes that point with it, so that it is done last: turned
    after that, the tool would turn about a point outside the trocar.
    """
    tilt, roll = 0.5, 0.4
    hand = strokes(
        Stroke((0.0, 0.0, 0.0, tilt, 0.0, roll), 0.4, "tool"),
        Stroke((0.0, 0.0, 0.0, -tilt, tilt, -roll), 0.4, "tool"),
        Stroke((0.0, 0.0, -0.08, 0.0, 0.0, 0.0), 0.35, "tool"),
        rest(),
    )
    return _scenario(
        "rcm-pivot", "turned about a trocar 8 cm behind the tip, and drawn back through it", ABOVE_TABLE_DEG,
        Phase(Mode.rcm(PIVOT), hand, hand.duration),
    )  # fmt: skip


def mode_switch() -> Scenario:
    """Go through the thesis's workflow (2.1) with joint velocities turned down to `CAREFUL`.

    Position the tip with the orientation fixed, align the tool with the position fixed, drill along its z. The modes
    are switched at once, the second time while the hand still pulls: the arm is then moving in a direction that the
    new mode locks.
    """
    robot = load_robot("lbr_med14")
    position = strokes(Stroke((0.10, 0.12, -0.12, 0.0, 0.0, 0.0), 0.5))
    align = strokes(Stroke((0.0, 0.0, 0.0, 0.3, 0.3, 0.2), 0.6))
    drill = strokes(Stroke((0.0, 0.0, 0.05, 0.0, 0.0, 0.0), 0.4, "tool"), rest())
    return _scenario(
        "mode-switch", "position, align, drill: three modes in a row, joint velocities turned down", ABOVE_TABLE_DEG,
        Phase(Mode.fix_orientation(), position, position.duration),
        # Cut short where the hand pulls hardest.
        Phase(Mode.fix_position(), align, 0.3),
        Phase(Mode.line("z"), drill, drill.duration),
        inputs={"qd_max": np.full(robot.nv, CAREFUL)},
    )  # fmt: skip


def _scenario(
    name: str,
    description: str,
    start_deg: tuple[float, ...],
    *phases: Phase,
    robot: str = "lbr_med14",
    inputs: Mapping[str, NDArray[np.float64]] | None = None,
) -> Scenario:
    return Scenario(
        name=name,
        description=description,
        robot=load_robot(robot),
        q0=np.deg2rad(start_deg),
        dt=DEFAULT_DT,
        phases=phases,
        inputs=inputs or {},
    )
