"""Where an arm's joints are: the line that is drawn of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import pinocchio as pin

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ...robots import Robot

    Array = NDArray[np.float64]

# Joint frames nearer than this are one place [m]: axes that intersect, as in a shoulder.
_SAME: Final = 1e-6


class Skeleton:
    """Corners of an arm's centre line, from its base to its tool.

    Parameters
    ----------
    robot : Robot
        Joint frames that coincide whatever the joints' positions are merged to one corner.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._data = robot.model.createData()
        rng = np.random.default_rng(0)
        drawn = np.array([self._frames(robot.random_configuration(rng)) for _ in range(4)])
        apart = np.max(np.linalg.norm(np.diff(drawn, axis=1), axis=2), axis=0) > _SAME
        # The base is the first corner; each frame belongs to the last corner that it is apart from what came before.
        self._corner_of = np.concatenate([[0], np.cumsum(apart)])
        self._kept = np.concatenate([[0], 1 + np.flatnonzero(apart)])

    @property
    def corners(self) -> int:
        """How many there are."""
        return len(self._kept)

    def corner(self, joint: int) -> int:
        """Index of the corner at which a joint (from 0) is."""
        return int(self._corner_of[joint + 1])

    def __call__(self, q: ArrayLike) -> Array:
        """Corners at joint positions of shape (nv,) [rad or m]: shape (corners, 3), base frame [m]."""
        corners: Array = self._frames(np.asarray(q, dtype=np.float64))[self._kept]
        return corners

    def _frames(self, q: Array) -> Array:
        """Origins of base, joints and tool, shape (nv + 2, 3) [m]."""
        robot = self._robot
        pin.forwardKinematics(robot.model, self._data, robot.to_pinocchio(q))
        joints = [self._data.oMi[number].translation for number in range(1, robot.model.njoints)]
        return np.array([np.zeros(3), *joints, robot.pose(q)[:3, 3]])
