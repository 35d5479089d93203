"""What a step is told of the tick before, where it takes that: the last command and the last acceleration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..solvers import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .loop import AnyStep

    Array = NDArray[np.float64]


class LastCommand:
    """Memory of a loop that calls a step at every tick; the arm starts at rest.

    Parameters
    ----------
    nv : int
        Number of joints.
    dt : float
        Control period [s].

    Attributes
    ----------
    qd : ndarray, shape (nv,)
        Last command [rad/s or m/s].
    qdd : ndarray, shape (nv,)
        Its difference from the one before, over `dt` [rad/s^2 or m/s^2]; zero after a safe stop.
    """

    def __init__(self, nv: int, dt: float) -> None:
        self._dt: Final = dt
        self.qd: Array = np.zeros(nv)
        self.qdd: Array = np.zeros(nv)

    def inputs(self, step: AnyStep) -> dict[str, Array]:
        """Give those of `qd_prev` and `qdd_prev` that a step takes."""
        memory = {"qd_prev": self.qd, "qdd_prev": self.qdd}
        return {name: last for name, last in memory.items() if name in step.inputs}

    def sent(self, qd: Array, *, stop: bool) -> None:
        """Remember a command that was sent, and whether it was a safe stop."""
        # The acceleration of a stop is not one to go on with: where jerk is limited, the arm would be carried past its
        # rest and back.
        self.qdd = np.zeros_like(qd) if stop else (qd - self.qd) / self._dt
        self.qd = qd


def is_stop(step: AnyStep, status: Status) -> bool:
    """Whether a command of this status is the step's safe stop.

    It is unless solved, but for a compiled step that keeps to admissible points: what that has come to at its cap of
    iterations is a command like any other.
    """
    capped = status is Status.MAX_ITERATIONS and bool(getattr(step, "feasible", False))
    return status is not Status.SOLVED and not capped
