"""What one control cycle returns, however it was computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..robots import real_array

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ..solvers import Status

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class StepResult:
    """The command of one control cycle and how it came about.

    Attributes
    ----------
    qd : ndarray, shape (nv,)
        Joint velocity command [rad/s or m/s]; the safe stop (zero, or the fastest admissible braking; see
        `Formulation.safe_stop`) unless `status` is SOLVED.
    eps : ndarray, shape (m_free,)
        Cartesian error J_free qd - v of that command [m/s, rad/s].
    status : Status
        SOLVED, or why the command is the safe stop.
    iterations : int or None
        As the solver counts them; None where it tells no count.
    active : tuple of str
        Rows that hold the solution back, as in "joint limits[3] upper"; empty at a safe stop.
    fixed_error : float
        Largest error of the locked rows, max |J_fixed qd - v_fixed| [m/s, rad/s].
    bound_violation : float
        Largest excess over the joint velocity bounds, zero if none [rad/s or m/s]. Like `fixed_error`, of what the
        solver proposed, also where that was refused.
    sigma_min : float
        Smallest singular value of J_bar, the guided rows within the null space of the locked ones.
    setup_time, solve_time : float
        Time of set-up or update, and of the solve itself, through Python [s].
    message : str
        One sentence where `status` is not SOLVED, or where a baseline exceeds what it does not promise.
    """

    qd: Array
    eps: Array
    status: Status
    iterations: int | None
    active: tuple[str, ...]
    fixed_error: float
    bound_violation: float
    sigma_min: float
    setup_time: float
    solve_time: float
    message: str


def one_by_one(
    step: Callable[..., StepResult], Q: ArrayLike, V: ArrayLike, inputs: dict[str, ArrayLike]
) -> list[StepResult]:
    """Call a step for each of the states Q, shape (N, nv), and hands V, shape (N, m_free); the same inputs for all.

    Raises
    ------
    ValueError
        When Q and V have not as many rows.
    """
    states, twists = real_array("Q", Q), real_array("V", V)
    if states.ndim != 2 or twists.ndim != 2 or len(states) != len(twists):
        raise ValueError(f"Q and V: expected as many rows in both, got shapes {states.shape}, {twists.shape}")
    return [step(q, v, **inputs) for q, v in zip(states, twists, strict=True)]
