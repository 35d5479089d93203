"""What a compiled command is worth in the interpreted step's own problem: does it keep the rows, and what does it cost.

Where a state does not say which command is right, two right answers can be far apart: along a direction that costs
nothing, or where a row is as good as absent. What must hold of each of them all the same is that it keeps the rows, and
that the other one is no better.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ...solvers import QP, Status, get_solver
from .answers import inputs_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ...control import InterpretedStep
    from ...formulations import Instance
    from .states import StateSet
    from .tally import Row

    Array = NDArray[np.float64]

#: Of rows and command, relative to their terms; of costs, relative to their terms and to what a move of x costs.
TOLERANCE: Final = 1e-9
# The x of a command is looked for until command and equalities are met to this share of the tolerance.
_MET: Final = 0.1
# ... or, where they can't be, to this multiple of the least error.
_NEARLY: Final = 1.5


def judge_worth(
    row: Row,
    step: InterpretedStep,
    states: StateSet,
    given: Mapping[str, ArrayLike],
    compiled: tuple[Array, NDArray[np.intc]],
    apart: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Check rows and cost of compiled commands, of the states that both solved.

    Parameters
    ----------
    row : Row
    step : InterpretedStep
        With the reference's solver.
    states : StateSet
        N of them, or more.
    given : mapping of str to array_like
        Run-time inputs, of which the step takes its own.
    compiled : (ndarray, ndarray)
        Commands and status codes of N states, or more.
    apart : ndarray of bool, shape (N,)
        States whose commands are apart; how many of them are worth the same is noted.

    Returns
    -------
    ndarray of bool, shape (N,)
        Which states are apart and not worth the same.
    """
    rows, costs = np.zeros(len(apart)), np.zeros(len(apart))
    for i in np.flatnonzero(compiled[1][: len(apart)] == 0):
        result = step(states.q[i], states.v[i], **inputs_of(step.inputs, states, int(i), given))
        if result.status is Status.SOLVED:
            each = [worth(instance, solution.x, compiled[0][i]) for instance, solution in step.solved]
            rows[i], costs[i] = np.max(each, axis=0)
    row.notes["parity or apart broken"] = int(np.sum(apart))
    as_much = np.maximum(rows, costs) <= TOLERANCE
    row.notes["parity or apart broken, and worth as much"] = int(np.sum(apart & as_much))
    row.check("compiled rows", rows, TOLERANCE, states)
    row.check("compiled cost", costs, TOLERANCE, states)
    return np.asarray(apart & ~as_much)


def worth(instance: Instance, x: Array, qd: Array) -> tuple[float, float]:
    """Give how far a command is outside a problem's rows, and its cost above that of the problem's answer.

    Parameters
    ----------
    instance : Instance
        The problem at a state.
    x : ndarray, shape (n,)
        Its answer.
    qd : ndarray, shape (nv,)
        The command [rad/s or m/s]. What it leaves open in x, such as the scale of a task at rest, is chosen for it.

    Returns
    -------
    outside, above : float
        Relative, see `TOLERANCE`; costs below the answer's are 0.
    """
    qp = instance.qp
    largest = max(1.0, float(np.abs(qd).max()))
    both = np.vstack([instance.K / largest, qp.A])
    off = np.concatenate([(qd - instance.K @ x - instance.k) / largest, qp.b - qp.A @ x])
    # At acceleration level x is some 1/dt times a command.
    reach = float(np.abs(instance.K).max())
    unit = max(1.0, 1.0 / reach) if reach > 0.0 else 1.0
    move, left = _least(both, off, _MET * TOLERANCE)
    if left.size:
        move = move + left @ _best_left(qp, x + move, left, unit)
    there = x + move
    told = np.abs(instance.K @ there + instance.k - qd) / largest
    value, terms = qp.stacked @ there, np.maximum(np.abs(qp.stacked) @ np.abs(there), unit)
    missed = np.maximum(np.maximum(value - qp.upper, qp.lower - value), 0.0) / terms
    slope, size = qp.H @ x + qp.g, max(unit, float(np.abs(x).max()))
    difference = float(slope @ move + 0.5 * move @ qp.H @ move)
    scale = max(abs(0.5 * float(y @ qp.H @ y)) + abs(float(qp.g @ y)) for y in (x, there))
    # What constants a cost has is not known here: at its minimum it may be all but zero in what is left.
    scale += float(np.abs(slope).sum()) * size + TOLERANCE * float(np.abs(qp.H).max()) * size * size
    # Where nothing is asked and nothing costs, both are zero.
    above = difference / scale if difference > 0.0 else 0.0
    return max(float(told.max()), float(missed.max(initial=0.0))), above


def _least(matrix: Array, wanted: Array, enough: float) -> tuple[Array, Array]:
    """Solve matrix x = wanted by as few singular directions, the largest first, as meet it to what is enough.

    In the others x would be rounding of the command, divided by a singular value of next to nothing. Where none are
    enough it is met about as well as it can be. Also gives the directions that change nothing, as columns.
    """
    left, sigma, right = np.linalg.svd(matrix)
    rank = int(np.sum(sigma > 10.0 * np.finfo(float).eps * sigma[0]))
    along = left[:, :rank].T @ wanted
    # What is left of `wanted` after 0, 1, ... directions.
    rest = wanted - np.vstack([np.zeros(wanted.size), np.cumsum(along[:, None] * left[:, :rank].T, axis=0)])
    off = np.abs(rest).max(axis=1)
    used = int(np.argmax(off <= max(enough, _NEARLY * float(off.min()))))
    return (along[:used] / sigma[:used]) @ right[:used], right[rank:].T


def _best_left(qp: QP, x: Array, left: Array, unit: float) -> Array:
    """Least cost among x + left t that keep the two-sided rows; no move where none does."""
    rows, lower, upper = qp.stacked[qp.m_eq :], qp.lower[qp.m_eq :], qp.upper[qp.m_eq :]
    value = rows @ x
    # Half of what is allowed: the other half is for the rounding of this.
    slack = 0.5 * TOLERANCE * np.maximum(np.abs(rows) @ np.abs(x), unit)
    gradient = left.T @ (qp.H @ x + qp.g)
    part = QP(H=left.T @ qp.H @ left, g=gradient, C=rows @ left, l=lower - slack - value, u=upper + slack - value)
    found = get_solver("active-set").solve(part)
    return found.x if found.solved else np.zeros(left.shape[1])
