"""The simulated operator: a hand that guides the tool along a path, waits for it, and steers around stops."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Final

import numpy as np

from ..robots import real_array
from .hand import EXPERT, SpringHand, length, rotation_vector
from .reference import WaitingReference
from .steering import Doing, Steering

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from .hand import Character
    from .paths import Path

    Array = NDArray[np.float64]


class Operator:
    """A person who guides the tool along a path.

    The hand is a spring and damper with a ceiling (`SpringHand`) between the tool and where it aims. The aim is the
    reference on the path, which waits for the tool (`WaitingReference`), plus an offset by which the person steers
    (`Steering`). Perceptions reach the person's will one reaction time late; the hand's mechanics act at once. The
    orientation found at the beginning is held by a rotational spring and damper.

    The same seed gives the same behaviour, tremor included. Model, equations, parameters: docs/operator.md.

    Parameters
    ----------
    path : Path
        To be followed, from its beginning.
    character : Character
        `EXPERT`, `NOVICE`, or one of your own.
    seed : int or sequence of int
        Of the tremor, and of which side is tried first.
    stance : array_like, shape (3,), optional
        From the tool towards the person, in the world, of any length: which side he thinks is clear.
    tremor : bool
        Whether the hand trembles.
    tolerance : float
        The tool has arrived within this distance of the path's end [m].

    Raises
    ------
    ValueError
        Naming the argument that is not usable.
    """

    def __init__(
        self,
        path: Path,
        character: Character = EXPERT,
        *,
        seed: int | tuple[int, ...] = 0,
        stance: ArrayLike | None = None,
        tremor: bool = True,
        tolerance: float = 0.01,
    ) -> None:
        towards = None if stance is None else real_array("stance", stance).copy()
        if towards is not None and not (towards.shape == (3,) and np.isfinite(towards).all() and towards.any()):
            raise ValueError(f"stance: expected a vector of shape (3,), not zero, got {stance!r}")
        if not (np.isfinite(tolerance) and tolerance > 0.0):
            raise ValueError(f"tolerance: expected a positive distance [m], got {tolerance}")
        self.path: Final = path
        self.character: Final = character
        self._seed: Final = (seed,) if isinstance(seed, int) else tuple(seed)
        self._stance: Final = towards
        self._tolerance: Final = tolerance
        self._end: Final = path.point(path.length)
        self._hand: Final = SpringHand(character, (*self._seed, 0) if tremor else None)
        self._reference: Final = WaitingReference(path, character.speed, character.lead)
        self.reset()

    def reset(self) -> None:
        """Begin from the start, with the same seed."""
        self._reference.reset()
        self._steering = Steering(self.path, self.character, self._stance, np.random.default_rng((*self._seed, 1)))
        self._felt: deque[tuple[float, float, Array]] = deque()
        self._t: float | None = None
        self._held: Array | None = None
        self._aim: Array = self.path.point(0.0)
        self._force: Array = np.zeros(3)
        self._arrived = False

    @property
    def doing(self) -> Doing:
        """What he is at."""
        return self._steering.doing

    @property
    def stops(self) -> int:
        """How many stops he has noticed."""
        return self._steering.stops

    @property
    def progress(self) -> float:
        """How far along the path the tool is [m]."""
        return self._reference.tool

    @property
    def aim(self) -> Array:
        """Where he wants the tool to be, shape (3,) [m]."""
        return self._aim.copy()

    def wrench(self, t: float, pose: Array, twist: Array) -> Array:
        """Give what the hand does at time `t` [s]; as `simulate_guiding` asks for it.

        Raises
        ------
        ValueError
            When time goes back: `reset` comes first then.
        """
        dt = self._elapsed(t)
        position, velocity = pose[:3, 3], twist[:3]
        if self._held is None:
            self._held = np.array(pose[:3, :3])
        deviation = self._reference.locate(position)
        lead_felt, deviation_felt = self._late(t, self._reference.lead, deviation)
        aim = self._move_aim(t, dt, position, velocity, lead_felt, deviation_felt)
        aim_velocity = (aim - self._aim) / dt if dt > 0.0 else np.zeros(3)
        self._aim = aim
        self._force = self._hand.force(t, aim - position, aim_velocity - velocity, self._steering.gain)
        torque = self._hand.torque(rotation_vector(pose[:3, :3] @ self._held.T), twist[3:])
        at_end = self._reference.tool >= self.path.length - self._tolerance
        self._arrived = at_end and length(position - self._end) <= self._tolerance
        return np.concatenate([self._force, torque])

    def finished(self, t: float) -> bool:  # noqa: ARG002  # the protocol's
        """Whether the tool has arrived at the end of the path."""
        return self._arrived

    def _elapsed(self, t: float) -> float:
        dt = 0.0 if self._t is None else t - self._t
        if not (np.isfinite(t) and dt >= 0.0):
            raise ValueError(f"t: expected a time of at least {self._t} s, as the last one was, got {t}; or reset()")
        self._t = t
        return dt

    def _late(self, t: float, lead: float, deviation: Array) -> tuple[float, Array]:
        """Lead and deviation as they were one reaction time ago."""
        felt = self._felt
        felt.append((t, lead, deviation))
        then = t - self.character.reaction_time
        while len(felt) > 1 and felt[1][0] <= then:
            felt.popleft()
        return felt[0][1], felt[0][2]

    def _move_aim(
        self, t: float, dt: float, position: Array, velocity: Array, lead_felt: float, deviation_felt: Array
    ) -> Array:
        """Where the hand wants to be now, shape (3,) [m]."""
        steering, reference, pull = self._steering, self._reference, self._force
        strength = length(pull)
        steering.feel(t, length(velocity), strength, reference.tool)
        if steering.out_of_patience(t) and strength > 0.0:
            steering.back_off(t, position, pull / strength, reference.tool)
        steering.stiffen(dt)
        if steering.doing is Doing.BACKING_OFF:
            aim = steering.towards_goal(t, dt, self._aim)
            if steering.is_back(t, aim):
                reference.begin_again()
                steering.follow_again(t, aim, self.path.point(reference.s))
            return aim
        reference.advance(dt, lead_felt)
        steering.follow(dt, deviation_felt)
        return self.path.point(reference.s) + steering.offset
