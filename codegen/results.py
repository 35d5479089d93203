"""What a compiled step returns, for one control cycle and for many."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from ..solvers.active_set import STATUSES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..solvers import Status

    Array = NDArray[np.float64]
    Integers = NDArray[np.intc]


class TickResult(NamedTuple):
    """The command of one control cycle; a tuple, because making one takes a third of the time of a dataclass.

    Attributes
    ----------
    qd : ndarray, shape (nv,)
        Joint velocity command [rad/s or m/s]; the safe stop (zero, or the fastest admissible braking; see
        `Formulation.safe_stop`) unless `status` is SOLVED, or MAX_ITERATIONS of a step that keeps to admissible points.
    eps : ndarray, shape (m_free,)
        Cartesian error J_free qd - v [m/s, rad/s].
    status : Status
    iterations : int
        Active-set steps.
    sides : ndarray of int, shape (rows,)
        -1, 0 or +1 for each row: which of its sides holds the command back.
    rows : tuple of str
        Names of the rows.
    """

    qd: Array
    eps: Array
    status: Status
    iterations: int
    sides: Integers
    rows: tuple[str, ...]

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the rows that hold the command back, each once, with their side: "joint limits[3] upper"."""
        names = (
            f"{name} {'upper' if side > 0 else 'lower'}"
            for name, side in zip(self.rows, self.sides, strict=True)
            if side
        )
        # Levels of a hierarchy name the same limits.
        return tuple(dict.fromkeys(names))


@dataclass(frozen=True, slots=True)
class BatchResult:
    """The commands of many control cycles.

    Attributes
    ----------
    qd : ndarray, shape (N, nv)
        [rad/s or m/s].
    eps : ndarray, shape (N, m_free)
        [m/s, rad/s].
    codes : ndarray of int, shape (N,)
        Status by number, 0 being SOLVED; see `status`.
    iterations : ndarray of int, shape (N,)
    sides : ndarray of int, shape (N, rows)
        As in `TickResult`.
    rows : tuple of str
        Names of the rows.
    """

    qd: Array
    eps: Array
    codes: Integers
    iterations: Integers
    sides: Integers
    rows: tuple[str, ...]

    @property
    def status(self) -> tuple[Status, ...]:
        """Status of each tick."""
        return tuple(STATUSES[code] for code in self.codes)
