"""Joint positions as they are likely to be: what was commanded, drawn towards what was measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from ..formulations import DEFAULT_DT
from ..formulations.buffered import BufferedFunction
from .checks import checked_array, checked_period

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

# A measurement further than this from what is expected is not noise [rad or m]: ten times what an arm that follows with
# a lag of 10 ms is behind at 0.5 rad/s.
JUMP: Final = 0.05


def observed(measured: ca.SX, last: ca.SX, qd: ca.SX, gain: ca.SX, jump: ca.SX, dt: ca.SX) -> ca.SX:
    r"""Joint positions by a steady-state observer, shape (nv, 1) [rad or m].

    .. math:: \hat q = (1 - g)\,(\hat q_{prev} + \dot q_{prev}\,dt) + g\,q_{measured}

    Where one joint's measurement is further than `jump` from what is expected, the measurement counts for it.

    Parameters
    ----------
    measured, last : ca.SX, shape (nv, 1)
        Measured positions; the last result [rad or m].
    qd : ca.SX, shape (nv, 1)
        Last command [rad/s or m/s].
    gain : ca.SX, scalar
        g, above 0, at most 1 [-]. With 1 it is the measurement, to the last bit.
    jump, dt : ca.SX, scalars
        [rad or m], [s].
    """
    expected = last + dt * qd
    believed = gain * measured + (1 - gain) * expected
    return ca.if_else(ca.fabs(measured - expected) > jump, measured, ca.if_else(gain < 1, believed, measured))


class PositionObserver:
    """Takes the encoders' noise out of joint positions, knowing what the arm was told to do.

    The rows of a motion mode hold at the positions that a step is given. Next to singularities of these rows a command
    that holds them at noisy positions follows the noise; one that holds them here does not, and is nearer to holding
    them where the arm really is (docs/singularities.md has both, measured).

    A command enters at once, so that nothing is late on an arm that follows it. One that follows with a time constant T
    is seen up to T |qdd| dt / gain away from where it is, while it accelerates.

    Not to be shared between threads.

    Parameters
    ----------
    nv : int
        Number of joints.
    gain : float
        What a measurement counts for, above 0, at most 1 [-]: noise in the change from tick to tick is reduced to this
        share of it.
    dt : float
        Control period [s].
    jump : float
        A measurement further than this from what is expected is believed at once [rad or m].

    Raises
    ------
    ValueError
        Naming the parameter that is out of its range.
    """

    def __init__(self, nv: int, gain: float = 0.05, dt: float = DEFAULT_DT, *, jump: float = JUMP) -> None:
        if isinstance(nv, bool) or nv != int(nv) or nv < 1:
            raise ValueError(f"nv: expected a number of joints, got {nv!r}")
        self.nv: Final = int(nv)
        self.gain: Final = checked_gain("gain", gain)
        self.dt: Final = checked_period(dt)
        if not (np.isfinite(jump) and jump > 0.0):
            raise ValueError(f"jump: expected a positive number, got {jump!r}")
        self.jump: Final = float(jump)
        sizes = {"measured": nv, "last": nv, "qd": nv, "gain": 1, "jump": 1, "dt": 1}
        symbols = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
        self._function: Final = BufferedFunction("observe", symbols, {"q": observed(**symbols)})
        for name, value in (("gain", self.gain), ("jump", self.jump), ("dt", self.dt)):
            self._function.given[name][:] = value
        self._last: Array | None = None

    def reset(self) -> None:
        """Begin again: the next measurement is believed as it is."""
        self._last = None

    def __call__(self, measured: ArrayLike, qd_prev: ArrayLike) -> Array:
        """Give the joint positions of this tick, shape (nv,) [rad or m].

        Parameters
        ----------
        measured : array_like, shape (nv,)
            Measured positions [rad or m].
        qd_prev : array_like, shape (nv,)
            Command since the last call [rad/s or m/s]; without effect at the first one.

        Raises
        ------
        InputError
            Naming the one that has the wrong shape or is not finite.
        """
        position = checked_array("measured", measured, self.nv)
        command = checked_array("qd_prev", qd_prev, self.nv)
        given = self._function.given
        given["measured"][:] = position
        given["last"][:] = position if self._last is None else self._last
        given["qd"][:] = 0.0 if self._last is None else command
        self._function()
        self._last = self._function.results["q"][:, 0].copy()
        return self._last.copy()


def checked_gain(name: str, gain: float) -> float:
    """See that a gain of an observer is above 0 and at most 1.

    Raises
    ------
    ValueError
        Naming it.
    """
    if not (np.isfinite(gain) and 0.0 < gain <= 1.0):
        raise ValueError(f"{name}: expected a number above 0 and at most 1, got {gain!r}")
    return float(gain)
