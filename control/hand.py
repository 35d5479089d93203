"""A hand on the tool: a spring and a damper with a ceiling, and what tells an expert from a novice."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from math import atan2, sqrt
from typing import TYPE_CHECKING, Final

import numpy as np

from .tremor import Tremor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# How much people of one character differ from each other: standard deviation of a parameter's logarithm.
_SPREAD: Final = 0.15
_VARIED: Final = ("stiffness", "damping", "ceiling", "reaction_time", "tremor", "speed", "lead", "patience")


@dataclass(frozen=True)
class Character:
    """How a person guides a robot; sources and reasons are in docs/operator.md.

    Attributes
    ----------
    name : str
        "expert", "novice", ...
    stiffness, damping : float
        Of the hand about the point where it wants to be [N/m, N s/m].
    ceiling : float
        Largest force [N].
    rotational_stiffness, rotational_damping : float
        Of the hand about the orientation that it holds [Nm/rad, Nm s/rad].
    torque_ceiling : float
        Largest torque [Nm].
    tremor, tremor_share : float
        RMS of the tremor of each component of the force: with the hand at rest [N], and what is added per force [-].
    speed : float
        At which he likes to move along a path [m/s].
    lead : float
        How far ahead of the tool he lets his aim run before he waits [m]; above half of it he slows down.
    reaction_time : float
        From something being felt to an answer to it [s]; the spring and damper themselves act at once.
    patience : float
        For how long he pushes against a stop that he has noticed, before he tries something else [s].
    push_gain : float
        By which factor he stiffens meanwhile (at least 1).
    press : float
        With which force he goes on pressing towards the path when the tool is kept from it; he yields to more [N].
    steer_speed : float
        Speed of his aim when he backs off [m/s].
    back_off, side_step : float
        How far he goes back from a stop, and to the side [m].
    knows_side : float
        Probability that he tries the side towards himself first, and not just any.

    Raises
    ------
    ValueError
        Naming the parameter that is out of its range.
    """

    name: str
    stiffness: float
    damping: float
    ceiling: float
    rotational_stiffness: float
    rotational_damping: float
    torque_ceiling: float
    tremor: float
    tremor_share: float
    speed: float
    lead: float
    reaction_time: float
    patience: float
    push_gain: float
    press: float
    steer_speed: float
    back_off: float
    side_step: float
    knows_side: float

    def __post_init__(self) -> None:
        for name, value in self.parameters().items():
            low = 1.0 if name == "push_gain" else 0.0
            high = 1.0 if name == "knows_side" else np.inf
            if not (low <= value <= high and np.isfinite(value)):
                raise ValueError(f"{self.name}: {name}: expected a number from {low:g} to {high:g}, got {value}")
        for name in ("stiffness", "ceiling", "torque_ceiling", "speed", "lead", "steer_speed"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{self.name}: {name}: expected a positive number, got {getattr(self, name)}")

    def parameters(self) -> dict[str, float]:
        """Return all numbers by name."""
        return {name: value for name, value in asdict(self).items() if name != "name"}

    def individual(self, rng: np.random.Generator) -> Character:
        """Draw a person of this character: eight of its parameters vary lognormally, by 15 %."""
        factors = np.exp(_SPREAD * rng.standard_normal(len(_VARIED)))
        varied = {name: getattr(self, name) * float(f) for name, f in zip(_VARIED, factors, strict=True)}
        return replace(self, **varied)


EXPERT: Final = Character(
    name="expert",
    stiffness=250.0,
    damping=20.0,
    ceiling=25.0,
    rotational_stiffness=4.0,
    rotational_damping=0.2,
    torque_ceiling=2.0,
    tremor=0.05,
    tremor_share=0.005,
    speed=0.20,
    lead=0.12,
    reaction_time=0.18,
    patience=0.2,
    push_gain=1.2,
    press=4.0,
    steer_speed=0.25,
    back_off=0.02,
    side_step=0.05,
    knows_side=1.0,
)
NOVICE: Final = Character(
    name="novice",
    stiffness=400.0,
    damping=30.0,
    ceiling=45.0,
    rotational_stiffness=6.0,
    rotational_damping=0.3,
    torque_ceiling=3.0,
    tremor=0.10,
    tremor_share=0.01,
    speed=0.20,
    lead=0.15,
    reaction_time=0.35,
    patience=1.0,
    push_gain=2.5,
    press=15.0,
    steer_speed=0.40,
    back_off=0.04,
    side_step=0.05,
    knows_side=0.25,
)
#: The two that the study has, by name.
CHARACTERS: Final[dict[str, Character]] = {"expert": EXPERT, "novice": NOVICE}


class SpringHand:
    r"""The mechanics of a hand on the tool.

    .. math:: F = K (x_h - x) + D (\dot x_h - \dot x) + F_{tremor}, \qquad |F| \le F_{max}

    with :math:`x_h` where the hand wants to be. Where the ceiling is reached, the direction is kept. The torque is
    a spring and damper about the orientation held, :math:`\tau = -K_r\,\vartheta - D_r\,\omega`, with its own ceiling.
    Tremor grows linearly with the force (Sutton, Sykes 1967).

    Parameters
    ----------
    character : Character
        Its stiffness, damping, ceilings and tremor.
    seed : int or sequence of int, optional
        Of the tremor; None: a hand without any.
    """

    def __init__(self, character: Character, seed: int | Sequence[int] | None) -> None:
        self._character: Final = character
        self._tremor: Final = None if seed is None else Tremor(seed, axes=3)

    def force(self, t: float, gap: Array, velocity_gap: Array, gain: float = 1.0) -> Array:
        """Give the force, shape (3,) [N].

        Parameters
        ----------
        t : float
            Time, for the tremor [s].
        gap, velocity_gap : ndarray, shape (3,)
            Where the hand wants to be as seen from where it is [m], and the same for its velocity [m/s].
        gain : float
            Factor of the stiffness; the damping grows by its root, so that the hand is damped as well as before.
        """
        c = self._character
        force = gain * c.stiffness * gap + sqrt(gain) * c.damping * velocity_gap
        force = limited(force, c.ceiling)
        if self._tremor is None:
            return force
        rms = c.tremor + c.tremor_share * length(force)
        return limited(force + rms * self._tremor(t), c.ceiling)

    def torque(self, turned: Array, angular_velocity: Array) -> Array:
        """Give the torque, shape (3,) [Nm], turned by a rotation vector [rad] from what is held, at a rate [rad/s]."""
        c = self._character
        torque: Array = -c.rotational_stiffness * turned - c.rotational_damping * angular_velocity
        return limited(torque, c.torque_ceiling)


def length(vector: Array) -> float:
    """Return the Euclidean norm; a third of the time that NumPy's takes, for vectors that are short."""
    return sqrt(vector @ vector)


def limited(vector: Array, ceiling: float) -> Array:
    """Return the vector, shortened to `ceiling` if it is longer."""
    size = length(vector)
    shortened: Array = vector if size <= ceiling else vector * (ceiling / size)
    return shortened


def rotation_vector(rotation: Array) -> Array:
    """Return axis times angle [rad] of a rotation matrix (3, 3), shape (3,), the angle at most pi."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    x, y, z = 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)
    sine, cosine = sqrt(x * x + y * y + z * z), 0.5 * (xx + yy + zz - 1.0)
    angle = atan2(sine, cosine)
    if sine > 1e-9 or cosine > 0.0:
        share = angle / sine if sine > 1e-9 else 1.0
        return np.array([share * x, share * y, share * z])
    # Half a turn: the axis is that of the largest column of (R + I) / 2, which is the axis times itself.
    symmetric = 0.5 * (rotation + np.eye(3))
    column = symmetric[:, int(np.argmax(np.diag(symmetric)))]
    half_turn: Array = angle / length(column) * column
    return half_turn
