"""What rounding of a state does to the interpreted command, for commands that nothing else explains.

Near a singularity of the locked rows, or where a cost is all but flat, the last bit of a row decides the command. Two
codes that round differently are then as far apart as one of them is from itself, a few units in the last place away.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ...solvers import Status
from .answers import inputs_of
from .compiled import PARITY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ...control import InterpretedStep
    from .states import StateSet
    from .tally import Row

    Array = NDArray[np.float64]

#: How far the joints are moved [rad or m]: a few units in the last place at half a turn.
MOVES: Final = (1e-15, 4e-15, 1e-14)
_DRAWS: Final = 12
# Of the range that the interpreted commands span, so much more on either side.
_BEYOND: Final = 1.0


def judge_rounding(
    row: Row,
    step: InterpretedStep,
    states: StateSet,
    given: Mapping[str, ArrayLike],
    qd: Array,
    unexplained: NDArray[np.bool_],
) -> None:
    """Check that compiled commands which are apart and not worth as much are within what rounding does.

    Parameters
    ----------
    row : Row
    step : InterpretedStep
        With the reference's solver.
    states : StateSet
        N of them, or more.
    given : mapping of str to array_like
        Run-time inputs, of which the step takes its own.
    qd : ndarray, shape (N, nv), or more
        Compiled commands [rad/s or m/s].
    unexplained : ndarray of bool, shape (N,)
        The states to look at.
    """
    left = np.zeros(len(unexplained))
    for i in np.flatnonzero(unexplained):
        left[i] = not within(qd[i], commands_around(step, states, int(i), given))
    row.notes["parity or apart broken, not worth as much, but within what rounding of the state does"] = int(
        np.sum(unexplained & (left < 1.0))
    )
    row.check("unexplained", left, 0.0, states)


def commands_around(step: InterpretedStep, states: StateSet, index: int, given: Mapping[str, ArrayLike]) -> Array:
    """Interpreted commands at a state and at some that differ from it by rounding, shape (K, nv); those solved."""
    rng = np.random.default_rng(index)
    q, v = states.q[index], states.v[index]
    taken = inputs_of(step.inputs, states, index, given)
    near = [q, *(q + size * rng.choice([-1.0, 0.0, 1.0], q.size) for size in MOVES for _ in range(_DRAWS))]
    results = [step(each, v, **taken) for each in near]
    return np.array([result.qd for result in results if result.status is Status.SOLVED]).reshape(-1, q.size)


def within(qd: Array, commands: Array) -> bool:
    """Whether a command is, joint by joint, within the range of others, or beyond by no more than that range.

    Parameters
    ----------
    qd : ndarray, shape (nv,)
    commands : ndarray, shape (K, nv)
    """
    if not len(commands):
        return False
    low, high = commands.min(axis=0), commands.max(axis=0)
    room = _BEYOND * (high - low) + PARITY * max(1.0, float(np.abs(commands).max()))
    return bool(np.all((qd >= low - room) & (qd <= high + room)))
