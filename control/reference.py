"""Where on a path a hand wants to be: a point that waits for the tool."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from .hand import length

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .paths import Path

    Array = NDArray[np.float64]

# Time in which a hand takes up a speed, and in which it comes to rest at the end of a path [s].
_TAKE_UP: Final = 0.15
_SETTLE: Final = 0.25


class WaitingReference:
    r"""A point on a path that moves on only as the tool follows.

    With the reference at arc length s and the tool abreast of :math:`s_x`, the lead is :math:`\ell = s - s_x`, and

    .. math:: \ddot s = (\dot s^* - \dot s) / \tau, \qquad
        \dot s^* = \min\Bigl(\dot s_0\,\mathrm{clip}\bigl(2 (1 - \ell / \ell_{max}), 0, 1\bigr),\ (L - s) / T\Bigr)

    so the reference moves with its own speed up to half the largest lead, ever slower beyond, and not at all at the
    largest; it comes to rest at the end of the path.

    Parameters
    ----------
    path : Path
        The curve.
    speed : float
        [m/s].
    lead : float
        The largest lead [m].

    Attributes
    ----------
    s, rate : float
        Arc length of the reference [m] and its speed [m/s].
    tool : float
        Arc length of the point of the path that the tool is abreast of [m].
    """

    def __init__(self, path: Path, speed: float, lead: float) -> None:
        self.path: Final = path
        self._speed: Final = speed
        self._lead: Final = lead
        self.reset()

    def reset(self) -> None:
        """Go back to the beginning of the path, at rest."""
        self.s = self.rate = self.tool = 0.0

    @property
    def lead(self) -> float:
        """How far the reference is ahead of the tool [m]."""
        return self.s - self.tool

    def locate(self, position: Array) -> Array:
        """Find the point abreast of the tool, near where it was, and give the tool's deviation from it, shape (3,) [m].

        One step of the fixed-point iteration s <- s + (x - p(s)) . t(s), whose error shrinks by the ratio of deviation
        and radius of curvature: a tool moves little in a control period.
        """
        path, before = self.path, self.tool
        away, tangent = position - path.point(before), path.tangent(before)
        self.tool = min(max(before + float(away @ tangent), 0.0), path.length)
        # As seen from the point found; what the path bends by in one step is of second order.
        deviation: Array = away - (self.tool - before) * tangent
        return deviation

    def advance(self, dt: float, lead: float) -> None:
        """Move on for `dt` [s], with the lead as it is felt [m], which is late."""
        room = min(max(2.0 * (1.0 - lead / self._lead), 0.0), 1.0)
        wanted = min(self._speed * room, (self.path.length - self.s) / _SETTLE)
        self.rate += (wanted - self.rate) * min(dt / _TAKE_UP, 1.0)
        self.s = min(self.s + dt * self.rate, self.path.length)

    def begin_again(self) -> None:
        """Begin again, at rest, where the tool is."""
        self.s, self.rate = self.tool, 0.0


def normal_of(path: Path, s: float) -> Array:
    """Give a unit vector perpendicular to a path, towards its inside where it is curved, shape (3,)."""
    tangent, step = path.tangent(s), 1e-3 * path.length
    change = path.tangent(min(s + step, path.length)) - path.tangent(max(s - step, 0.0))
    change = change - (change @ tangent) * tangent
    if length(change) < 1e-6:
        # Straight: the axis of the world that is least along it.
        change = np.eye(3)[int(np.argmin(np.abs(tangent)))]
        change = change - (change @ tangent) * tangent
    normal: Array = change / length(change)
    return normal
