"""What a scenario is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ...control import Guide
    from ...formulations import Mode
    from ...robots import Robot


@dataclass(frozen=True)
class Scenario:
    """A closed-loop job for any controller.

    Attributes
    ----------
    name, description : str
        As listed.
    robot : Robot
        The arm.
    mode : Mode
        Its motion mode.
    q0 : ndarray, shape (nv,)
        Start [rad or m].
    guide : Guide
        Who guides the tool.
    duration, dt : float
        Length of the run and control period [s].
    watched_joint : int
        The joint (from 0) whose limit the scenario is about.
    """

    name: str
    description: str
    robot: Robot
    mode: Mode
    q0: NDArray[np.float64]
    guide: Guide
    duration: float
    dt: float
    watched_joint: int
