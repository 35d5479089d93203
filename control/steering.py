"""What a hand does when the tool does not go where it pulls: push, back off, go around."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Final

import numpy as np

from .hand import length
from .reference import normal_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .hand import Character
    from .paths import Path

    Array = NDArray[np.float64]

# The tool stands still for a hand below this speed [m/s], if it is pulled with more than this force [N]; it is off
# again above the other.
STILL: Final = 2e-3
PULLING: Final = 5.0
_MOVING: Final = 1e-2
# Time constants: of going along with a deviation, of stiffening, of relaxing [s].
_FOLLOW: Final = 0.3
_STIFFEN: Final = 0.3
_RELAX: Final = 0.2
# Backing off: time in which the aim takes up speed and settles [s], and how near to its goal is there [m].
_TAKE_UP: Final = 0.15
_SETTLE: Final = 0.10
_REACHED: Final = 5e-3
# An attempt that got less far than this beyond where it backed off from was on the wrong side, or not wide enough [m];
# then the step to the side grows by the factor, up to so many times what it was.
_PROGRESS: Final = 0.02
_WIDER: Final = 1.5
_WIDEST: Final = 3.0


class Doing(Enum):
    """What the hand is at."""

    FOLLOWING = "following"
    PUSHING = "pushing"
    BACKING_OFF = "backing off"


class Steering:
    """Where the hand aims beside the path, and how stiff it is.

    Three things follow each other:

    - *following*: where the tool is kept from the path, the hand goes along, as it felt it a reaction time ago, so far
      that it presses towards the path with the force `press` and no more. So it slides along a limit, and comes back to
      the path when it can.
    - *pushing*: the tool has stood still, pulled by more than 5 N, for a reaction time. The hand stiffens up to
      `push_gain`, until the tool moves, or patience is over.
    - *backing off*: the aim moves, at `steer_speed`, to a point back from where it pulled and a step to one side of the
      path. From there it follows the path again.

    The side is one of four (inside and outside of the path's curve, and to both sides of its plane), in an order that
    is drawn; it begins, with probability `knows_side`, with the one that is nearest to the person. A side is kept as
    long as it brings the hand forward from stop to stop; otherwise it is the next one's turn, by a step half as wide
    again (three times as wide at most).

    Parameters
    ----------
    path : Path
    character : Character
    stance : ndarray, shape (3,), optional
        From the tool towards the person, in the world; None: nobody knows the side.
    rng : numpy.random.Generator
        Draws the order of sides.

    Attributes
    ----------
    doing : Doing
    gain : float
        Factor of the hand's stiffness.
    offset : ndarray, shape (3,)
        From the path's point to where the hand aims [m].
    stops : int
        Times that the hand noticed a stop.
    """

    def __init__(self, path: Path, character: Character, stance: Array | None, rng: np.random.Generator) -> None:
        self._path: Final = path
        self._character: Final = character
        self._stance: Final = stance
        order = rng.permutation(4)
        self._order: Final = [int(number) for number in order]
        self._knows: Final = stance is not None and bool(rng.random() < character.knows_side)
        self.doing = Doing.FOLLOWING
        self.gain = 1.0
        self.offset: Array = np.zeros(3)
        self.stops = 0
        self._still_since: float | None = None
        self._since = self._began = 0.0
        self._turn = 0
        self._width = 1.0
        self._tried = False
        self._from = 0.0
        self._goal: Array = np.zeros(3)

    def feel(self, t: float, speed: float, force: float, s: float) -> None:
        """Take in how the tool moves: its speed [m/s], the hand's force [N], and how far it is along the path [m]."""
        if speed >= STILL or force <= PULLING:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = t
        c = self._character
        if self.doing is Doing.FOLLOWING:
            if self._still_since is not None and t - self._still_since >= c.reaction_time:
                self._switch(Doing.PUSHING, t)
                self.stops += 1
                if self._tried and s < self._from + _PROGRESS:
                    self._turn += 1
                    self._width = min(_WIDER * self._width, _WIDEST)
                self._tried = False
        elif self.doing is Doing.PUSHING and speed > _MOVING:
            self._switch(Doing.FOLLOWING, t)

    def out_of_patience(self, t: float) -> bool:
        """Whether it has pushed for as long as it will."""
        return self.doing is Doing.PUSHING and t - self._since >= self._character.patience

    def back_off(self, t: float, position: Array, pull: Array, s: float) -> None:
        """Begin to back off from where the tool stands, shape (3,) [m], pulled along a unit vector, at arc length s."""
        c = self._character
        self._goal = position - c.back_off * pull + self._width * c.side_step * self.side(s)
        self._tried, self._from = True, s
        self._switch(Doing.BACKING_OFF, t)

    def follow(self, dt: float, deviation: Array) -> None:
        """Go along with the tool's deviation as it was felt, shape (3,) [m], for `dt` [s]."""
        c = self._character
        pressed = c.stiffness * length(deviation)
        share = 1.0 - c.press / pressed if pressed > c.press else 0.0
        self.offset = self.offset + min(dt / _FOLLOW, 1.0) * (share * deviation - self.offset)

    def towards_goal(self, t: float, dt: float, aim: Array) -> Array:
        """Move the aim on for `dt` [s] while backing off, shape (3,) [m]; it takes up speed and settles smoothly."""
        way = self._goal - aim
        distance = length(way)
        speed = self._character.steer_speed * min((t - self._began) / _TAKE_UP, 1.0)
        share = min(dt * speed / distance, dt / _SETTLE, 1.0) if distance > 0.0 else 0.0
        moved: Array = aim + share * way
        return moved

    def is_back(self, t: float, aim: Array) -> bool:
        """Whether the aim has been moved back, and a reaction time given to the tool to come after it."""
        if self.doing is not Doing.BACKING_OFF:
            return False
        if length(self._goal - aim) > _REACHED:
            self._since = t
        return t - self._since >= self._character.reaction_time

    def follow_again(self, t: float, aim: Array, point: Array) -> None:
        """Follow the path again from `point` on it, aiming at `aim`, both of shape (3,) [m]."""
        self.offset = aim - point
        self._switch(Doing.FOLLOWING, t)

    def stiffen(self, dt: float) -> None:
        """Stiffen while pushing, relax otherwise, for `dt` [s]."""
        pushing = self.doing is Doing.PUSHING
        wanted, time = (self._character.push_gain, _STIFFEN) if pushing else (1.0, _RELAX)
        self.gain += min(dt / time, 1.0) * (wanted - self.gain)

    def side(self, s: float) -> Array:
        """Give the side that it tries now at arc length s [m] of the path, a unit vector, shape (3,)."""
        normal = normal_of(self._path, s)
        across = np.cross(self._path.tangent(s), normal)
        sides = np.array([normal, -normal, across, -across])
        order = self._order
        if self._knows and self._stance is not None:
            nearest = int(np.argmax(sides @ self._stance))
            order = [nearest, *(number for number in order if number != nearest)]
        chosen: Array = sides[order[self._turn % 4]]
        return chosen

    def _switch(self, doing: Doing, t: float) -> None:
        self.doing, self._since, self._began, self._still_since = doing, t, t, None
