"""`singular-elbow`, `singular-wrist`, `singular-shoulder`, `workspace-boundary`: the LBR where its Jacobian loses rank.

Shorter and slower relatives of the paths in `singular.py`, which docs/singularities.md is about. All end with a rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ...formulations import DEFAULT_DT, Mode
from ...robots import load_robot
from .base import Phase, Scenario
from .strokes import RAMP, Stroke, Strokes, pull, rest, strokes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SPEED: Final = 0.15
# Where the second joint's axis meets the first one's, in the world [m].
SHOULDER: Final = (0.0, 0.0, 0.36)
# The elbow bent by 25 deg: the wrist 2 cm from as far away from the shoulder as it gets.
ALMOST_STRETCHED_DEG: Final = (10.0, 40.0, 5.0, -25.0, -5.0, 60.0, 0.0)


def singular_elbow() -> Scenario:
    """Pull the tool straight out, 3 cm further than the arm reaches, and back in."""
    q0 = np.deg2rad(ALMOST_STRETCHED_DEG)
    out = _outwards(q0)
    hand = strokes(pull(out, SPEED, 0.05), pull(-out, SPEED, 0.08), rest())
    return _scenario("singular-elbow", "the arm pulled straight, past its reach, and back in", q0, hand)


def singular_wrist() -> Scenario:
    """Turn the tool, its position fixed, until joint 6 is at zero, then on about the axis that is lost there.

    With joint 5 at a right angle no other joint can take the place of the wrist's lost one.
    """
    q0 = np.deg2rad((0.0, 40.0, 0.0, -80.0, 90.0, 12.0, 0.0))
    sixth, seventh = load_robot("lbr_med14").jacobian(q0)[3:, 5:].T
    lost = np.cross(sixth, seventh)
    hand = strokes(_turn(-sixth, 0.5, 0.21), _turn(lost, 0.25, 0.1), rest())
    return _scenario("singular-wrist", "joint 6 to zero, two axes in line, then about the axis lost", q0, hand,
                     Mode.fix_position())  # fmt: skip


def singular_shoulder() -> Scenario:
    """Pull such that joint 2 goes to zero with joint 3 at a right angle: the axes of joints 1 and 3 are one."""
    robot = load_robot("lbr_med14")
    q0 = np.deg2rad((0.0, 8.0, 90.0, -80.0, 0.0, 60.0, 0.0))
    upright = q0.copy()
    upright[1] = 0.0
    towards = robot.pose(upright)[:3, 3] - robot.pose(q0)[:3, 3]
    hand = strokes(pull(towards, SPEED, 0.14), rest())
    return _scenario("singular-shoulder", "joint 2 through zero: two axes of the shoulder in line", q0, hand)


def workspace_boundary() -> Scenario:
    """Pull the tool outwards all the time while it moves up and down along the edge of its reach."""
    q0 = np.deg2rad(ALMOST_STRETCHED_DEG)
    out = _outwards(q0)
    up = np.array([0.0, 0.0, 1.0]) - out[2] * out
    up /= np.linalg.norm(up)
    hand = strokes(pull(out, SPEED, 0.03), pull(out + 2.0 * up, SPEED, 0.04), pull(out - 2.0 * up, SPEED, 0.04), rest())
    return _scenario("workspace-boundary", "along the edge of the reach, pulled outwards all the time", q0, hand)


def _outwards(q: Array) -> Array:
    """Unit vector from the shoulder to where the arm's wrist is, shape (3,)."""
    robot = load_robot("lbr_med14")
    pose = robot.pose(q)
    flange_to_wrist = 0.126
    wrist = pose[:3, 3] - flange_to_wrist * pose[:3, 2]
    out: Array = (wrist - np.array(SHOULDER)) / np.linalg.norm(wrist - np.array(SHOULDER))
    return out


def _turn(axis: Array, speed: float, angle: float) -> Stroke:
    """Turn about a unit axis in the world, shape (3,), with `speed` [rad/s], by `angle` [rad] in all."""
    x, y, z = (float(w) for w in speed * axis)
    return Stroke((0.0, 0.0, 0.0, x, y, z), angle / speed + RAMP)


def _scenario(name: str, description: str, q0: Array, hand: Strokes, mode: Mode | None = None) -> Scenario:
    return Scenario(
        name=name,
        description=description,
        robot=load_robot("lbr_med14"),
        q0=q0,
        dt=DEFAULT_DT,
        phases=(Phase(mode or Mode.fix_orientation(), hand, hand.duration),),
    )
