"""Paths of constant hand speed into and through singularities of the LBR Med 14, and along the edge of its reach."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from ...robots import load_robot

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROBOT: Final = "lbr_med14"
# Time in which the hand reaches its speed, and stops [s].
RAMP: Final = 0.3


@dataclass(frozen=True)
class Leg:
    """A straight piece of a path.

    Attributes
    ----------
    direction : tuple of 3 floats
        Of the hand's pull, in the axes of the path's mode; of any length.
    length : float
        What the hand asks for in all [m].
    """

    direction: tuple[float, float, float]
    length: float


@dataclass(frozen=True)
class SingularPath:
    """A hand that pulls at constant speed, whatever the arm does.

    Attributes
    ----------
    name, description : str
        As listed.
    start_deg : tuple of 7 floats
        Joint angles at the start [deg].
    legs : tuple of Leg
        One after the other, each from rest to rest.
    mode : str
        As in `Mode.parse`.
    q_max_deg : mapping of int to float
        Upper position limits in place of the robot's, by joint from 0 [deg].
    """

    name: str
    description: str
    start_deg: tuple[float, ...]
    legs: tuple[Leg, ...]
    mode: str = "fix-orientation"
    q_max_deg: Mapping[int, float] = field(default_factory=dict)

    @property
    def q0(self) -> Array:
        """Start, shape (7,) [rad]."""
        start: Array = np.deg2rad(np.array(self.start_deg))
        return start

    def duration(self, speed: float) -> float:
        """Time from start to rest at a hand speed [s]."""
        return sum(leg.length / speed + RAMP for leg in self.legs)

    def velocity(self, t: float, speed: float) -> Array:
        """Linear velocity asked for at time `t` [s], shape (3,) along the axes of the mode [m/s]."""
        for leg in self.legs:
            duration = leg.length / speed + RAMP
            if t < duration:
                direction = np.array(leg.direction) / np.linalg.norm(leg.direction)
                velocity: Array = speed * ramped(t, duration) * direction
                return velocity
            t -= duration
        return np.zeros(3)

    def twist(self, t: float, speed: float) -> Array:
        """Twist asked for at time `t` [s], shape (6,) along the axes of the mode [m/s, rad/s]."""
        return np.concatenate([self.velocity(t, speed), np.zeros(3)])


def ramped(t: float, duration: float) -> float:
    """Share of its speed that a hand has at `t` on a way from rest to rest [-]."""
    return _smooth(t / RAMP) * _smooth((duration - t) / RAMP)


def _smooth(x: float) -> float:
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


_BENT: Final = (10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0)


def _radial(start_deg: tuple[float, ...]) -> tuple[float, float, float]:
    """Away from the shoulder, 0.36 m above the base, through the tool."""
    robot = load_robot(ROBOT)
    return _mixed((1.0, tuple(robot.pose(np.deg2rad(np.array(start_deg)))[:3, 3] - np.array([0.0, 0.0, 0.36]))))


def _towards(start_deg: tuple[float, ...], end_deg: tuple[float, ...]) -> tuple[float, float, float]:
    """From the tool at one posture to the tool at another."""
    robot = load_robot(ROBOT)
    start, end = (robot.pose(np.deg2rad(np.array(angles, dtype=float)))[:3, 3] for angles in (start_deg, end_deg))
    return _mixed((1.0, tuple(end - start)))


def _mixed(*parts: tuple[float, tuple[float, ...]]) -> tuple[float, float, float]:
    """Sum unit vectors with factors."""
    unit = [factor * np.array(vector) / np.linalg.norm(vector) for factor, vector in parts]
    x, y, z = np.sum(unit, axis=0)
    return float(x), float(y), float(z)


def singular_paths() -> tuple[SingularPath, ...]:
    """The paths of the singular sweep; docs/singularities.md shows what each formulation makes of them."""
    out = _radial(_BENT)
    x, y, z = out
    sideways, upwards = (-y, x, 0.0), (-x * z, -y * z, x * x + y * y)
    back = _mixed((-1.0, out))
    outward = (Leg(out, 0.6), Leg(back, 0.6))
    along = (
        Leg(out, 0.36),
        Leg(_mixed((1.0, out), (2.0, upwards)), 0.3),
        Leg(_mixed((1.0, out), (-2.0, upwards)), 0.3),
        Leg(back, 0.3),
    )
    oblique = (Leg(_mixed((1.0, out), (1.0, sideways)), 0.4), Leg(_mixed((-1.0, out), (0.3, sideways)), 0.4))
    return (
        SingularPath("outward", "elbow straight: out past reach along the arm, and back in", _BENT, outward),
        SingularPath("oblique", "elbow straight: out past reach at 45 deg, back at another angle", _BENT, oblique),
        SingularPath("along", "along the edge of the reach, pulled outwards all the time", _BENT, along),
        SingularPath(
            "wrist", "wrist: joint 6 through zero", (0, 40, 0, -80, 0, 20, 0), (Leg((0.6, 0.0, -0.8), 0.36),)
        ),
        SingularPath(
            "shoulder", "shoulder: joint 2 through zero, joint 3 at 90 deg", (0, 25, 90, -80, 0, 60, 0),
            (Leg(_towards((0, 25, 90, -80, 0, 60, 0), (0, 0, 90, -80, 0, 60, 0)), 0.3),),
        ),
        SingularPath(
            # Joint 3 is what it takes for plain `joint-space` to meet the singularity itself: sigma_min below 1e-4.
            "shoulder, through", "shoulder: exactly through joint 2 zero, joint 3 at 90 deg",
            (0, 25, 89.6792915824710223, -60, 0, 60, 0),
            (Leg(_towards((0, 25, 90, -60, 0, 60, 0), (0, 0, 90, -60, 0, 60, 0)), 0.3),),
        ),
        SingularPath(
            "over", "over the base, where the wrist crosses the first axis, to the edge behind it",
            (20, -40, 20, 100, 10, 40, 0), (Leg((-1.0, -0.2, 0.0), 0.55),),
        ),
        SingularPath(
            "upright", "from upright, all axes in one plane, straight down", (0,) * 7, (Leg((0, 0, -1), 0.25),)
        ),
    )  # fmt: skip


def hard_paths() -> tuple[SingularPath, ...]:
    """Beyond the sweep: a joint at its limit at the singularity, and modes that leave more or less freedom."""
    paths = {path.name: path for path in singular_paths()}
    limited = {5: 30.0}
    return (
        *(
            SingularPath(f"{name}, limit", f"{name}, joint 6 held at 30 deg", paths[name].start_deg, paths[name].legs,
                         q_max_deg=limited)
            for name in ("outward", "oblique", "along")
        ),
        SingularPath("outward, position", "outward, orientation free", _BENT, paths["outward"].legs, "position"),
        SingularPath(
            "drill", "along the tool's z out past reach and back", (0, 30, 0, -70, 0, 40, 0),
            (Leg((0, 0, 1), 0.6), Leg((0, 0, -1), 0.6)), "line:z",
        ),
    )  # fmt: skip
