"""A hand that pushes, and does nothing else: for drilling."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..robots import real_array
from .hand import EXPERT, limited
from .tremor import Tremor

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from .hand import Character

    Array = NDArray[np.float64]

# The torque of a trembling hand: its force at the half width of a fist [m].
_GRIP: Final = 0.05


class Push:
    r"""A hand that pushes with a force and torque that wander slowly, and trembles.

    .. math:: w(t) = r(t)\,\bigl(1 + a\,n_{slow}(t)\bigr)\,w_0 + w_{tremor}(t)

    with a smooth ramp r over the first `ramp` seconds and seeded noise n between 0.05 and 0.5 Hz of unit RMS: nobody
    pushes with a constant force. The tremor is that of the character, on all six components (8 to 12 Hz); force and
    torque stay below the character's ceilings.

    Parameters
    ----------
    wrench : array_like, shape (6,)
        Force [N] and torque [Nm] on average.
    character : Character
        Its tremor and ceilings.
    seed : int
        Of wander and tremor.
    wander : float
        RMS of the slow change, as a share of the mean [-].
    ramp : float
        [s].
    tool_axes : bool
        Whether `wrench` is given along the tool's axes, as when one pushes along a drill; else along the world's.
    tremor : bool
        Whether the hand trembles.

    Raises
    ------
    ValueError
        Naming the argument that is not usable.
    """

    def __init__(
        self,
        wrench: ArrayLike,
        character: Character = EXPERT,
        *,
        seed: int = 0,
        wander: float = 0.2,
        ramp: float = 0.5,
        tool_axes: bool = False,
        tremor: bool = True,
    ) -> None:
        mean = real_array("wrench", wrench).copy()
        if mean.shape != (6,) or not np.isfinite(mean).all():
            raise ValueError(f"wrench: expected shape (6,), finite, got {wrench!r}")
        if not (0.0 <= wander < 1.0 and 0.0 <= ramp < np.inf):
            raise ValueError(f"expected a wander from 0 to below 1 and a ramp of at least 0 s, got {wander}, {ramp}")
        if not (np.linalg.norm(mean[:3]) <= character.ceiling and np.linalg.norm(mean[3:]) <= character.torque_ceiling):
            raise ValueError(
                f"wrench: expected at most {character.ceiling:g} N and {character.torque_ceiling:g} Nm, "
                f"the {character.name}'s ceilings, got {wrench!r}"
            )
        self._mean: Final = mean
        self._character: Final = character
        self._wander: Final = wander
        self._ramp: Final = ramp
        self._tool_axes: Final = tool_axes
        self._slow: Final = Tremor((seed, 1), axes=1, band=(0.05, 0.5))
        self._tremor: Final = Tremor((seed, 0), axes=6) if tremor else None

    def wrench(self, t: float, pose: Array, twist: Array) -> Array:  # noqa: ARG002  # it pushes, however the tool moves
        """Give the force [N] and torque [Nm] on the tool at time `t` [s] and pose (4, 4), shape (6,), world axes."""
        x = min(max(t / self._ramp, 0.0), 1.0) if self._ramp > 0.0 else 1.0
        share = x * x * (3.0 - 2.0 * x) * max(1.0 + self._wander * float(self._slow(t)[0]), 0.0)
        force, torque = share * self._mean[:3], share * self._mean[3:]
        if self._tool_axes:
            force, torque = pose[:3, :3] @ force, pose[:3, :3] @ torque
        c = self._character
        if self._tremor is not None:
            rms = c.tremor + c.tremor_share * float(np.linalg.norm(force))
            noise = self._tremor(t)
            force, torque = force + rms * noise[:3], torque + _GRIP * rms * noise[3:]
        return np.concatenate([limited(force, c.ceiling), limited(torque, c.torque_ceiling)])

    def finished(self, t: float) -> bool:  # noqa: ARG002  # the protocol's
        """Return False: he pushes for as long as he is asked to."""
        return False

    def reset(self) -> None:
        """Do nothing: what it does depends on the time alone."""
