"""Ticks at which the tool moves against the hand: v_commanded . v_actual < 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from ...solvers import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .ticks import Ticks

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]

# What counts as rounding: of the product of both speeds [-], and of their product itself [m^2/s^2, rad^2/s^2].
_RELATIVE: Final = 1e-9
_ABSOLUTE: Final = 1e-14
# Share of an acceleration limit from which on it counts as reached.
AT_ACCELERATION: Final = 0.999


@dataclass(frozen=True)
class AgainstHand:
    """How often, and why, the hand was worked against.

    With v what the hand asks for and v + eps what the tool does, both along the mode's guided rows, the power that a
    hand of v = F / B gets back is -F . (v + eps). Where v = 0 nothing is asked, and no tick counts.

    Attributes
    ----------
    against : int
        Ticks at which v . (v + eps) < 0 by more than rounding.
    against_speed : float
        Largest speed along -v [m/s, rad/s]; 0: none.
    against_share : float
        The same over |v|, of ticks at which the hand pulls [-].
    against_correction : int
        Those of the ticks at which the locked rows are to move, to correct a drift.
    against_stop : int
        Those of the rest at which the safe stop was sent.
    against_limit : int or None
        Those of the rest at which the tool did so before, now does it less, and some joint is at its acceleration limit
        or beyond: the hand turned around, and the arm is braking. None where the last command is not known, as of
        samples.
    against_slowing : int or None
        The same with all joints below their acceleration limits: the controller brakes more gently than it must.
    against_choice : int or None
        All others: motion against the hand that is new, or grows.
    """

    against: int
    against_speed: float
    against_share: float
    against_correction: int
    against_stop: int
    against_limit: int | None
    against_slowing: int | None
    against_choice: int | None

    @classmethod
    def of(cls, ticks: Ticks) -> AgainstHand:
        """Sum up a cell's ticks."""
        back, speed = against(ticks)
        share = np.where(ticks.pulling, speed / np.where(back, np.linalg.norm(ticks.v, axis=1), 1.0), 0.0)
        correction = back & bool(np.any(ticks.scenario.inputs.get("v_fixed", 0.0)))
        stop = back & ~correction & (ticks.words("status") != Status.SOLVED.value)
        left = back & ~correction & ~stop
        known = (
            float(np.max(speed, initial=0.0)),
            float(np.max(share, initial=0.0)),
            int(np.sum(correction)),
            int(np.sum(stop)),
        )
        before = _last_commands(ticks)
        if before is None:
            return cls(int(np.sum(back)), *known, None, None, None)
        slowing = left & _slowing(ticks, before, left)
        step = ticks.limit("qdd_max") * ticks.scenario.dt
        limit = slowing & np.any(np.abs(ticks.qd - before) >= AT_ACCELERATION * step, axis=1)
        counts = (int(np.sum(some)) for some in (limit, slowing & ~limit, left & ~slowing))
        return cls(int(np.sum(back)), *known, *counts)


def _last_commands(ticks: Ticks) -> Array | None:
    """What was sent before each tick, shape (N, nv); None where that is not known."""
    if ticks.closed_loop:
        return ticks.qd_before
    if ticks.scenario.states is None:
        return None
    rows = np.rint(ticks.column("t") / ticks.scenario.dt).astype(np.int64)
    given: Array = ticks.scenario.states.qd_prev[rows]
    return given


def _slowing(ticks: Ticks, before: Array, asked: Flags) -> Flags:
    """Those of the ticks asked at which the last command, sent again, would move the tool against the hand further."""
    flags = np.zeros(len(asked), dtype=bool)
    for row in np.flatnonzero(asked):
        mode = ticks.mode(int(ticks.phase[row]))
        free = list(mode.free_rows)
        rows = mode.twist_map_at(ticks.scenario.robot.pose(ticks.q[row])) @ ticks.scenario.robot.jacobian(ticks.q[row])
        v, eps = ticks.v[row][free], ticks.eps[row][free]
        flags[row] = v @ rows[free] @ before[row] < (1.0 + _RELATIVE) * (v @ (v + eps))
    return flags


def against(ticks: Ticks) -> tuple[Flags, Array]:
    """Ticks at which the tool moves against the hand, and with what speed along -v, zero elsewhere: shapes (N,)."""
    done = ticks.v + ticks.eps
    along = np.einsum("ti,ti->t", ticks.v, done)
    asked, made = np.linalg.norm(ticks.v, axis=1), np.linalg.norm(done, axis=1)
    back: Flags = along < -(_RELATIVE * asked * made + _ABSOLUTE)
    return back, np.where(back, -along / np.where(back, asked, 1.0), 0.0)
