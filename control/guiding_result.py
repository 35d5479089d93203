"""What a hand-guiding controller returns."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..formulations import Mode
    from ..solvers import Status

    Array = NDArray[np.float64]


class GuidingPhase(StrEnum):
    """What a hand-guiding controller is doing."""

    GUIDING = "guiding"
    STOPPING = "stopping"
    STOPPED = "stopped"


class GuidingResult(NamedTuple):
    """One control cycle of a hand-guiding controller.

    Attributes
    ----------
    qd : ndarray, shape (nv,)
        Joint velocity command [rad/s or m/s].
    v : ndarray, shape (m_free,)
        Velocity that the admittance asks for, along the mode's axes [m/s, rad/s].
    v_actual : ndarray, shape (m_free,)
        What the command gives of it, J_free qd [m/s, rad/s].
    status : Status
        Of the tick: SOLVED, or why the command is the safe stop; SOLVED too where there is nothing to solve.
    iterations : int or None
        As the solver counts them; None where it tells none.
    active : tuple of str
        Rows that hold the command back.
    mode : Mode
        The mode that is engaged.
    phase : GuidingPhase
        GUIDING, STOPPING (on the way to another mode or to a stop; the hand has no effect) or STOPPED.
    drift : ndarray, shape (2,)
        Distance and angle of the locked rows from where the mode was engaged, before the command [m, rad].
    yielded : bool
        Whether the drift compensation gave way, because limits could not follow it.
    held : int
        Ticks in a row, this one included, whose sample was not finite: up to `hold_ticks` the last one stands for it.
    """

    qd: Array
    v: Array
    v_actual: Array
    status: Status
    iterations: int | None
    active: tuple[str, ...]
    mode: Mode
    phase: GuidingPhase
    drift: Array
    yielded: bool
    held: int = 0
