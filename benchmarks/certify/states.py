"""The states that bounds are asked for at: drawn as the search for the worst tick draws them, or from a file."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ..worst_case.case import CaseError
from ..worst_case.states import Draws

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...codegen import CompiledStep

    Array = NDArray[np.float64]
    #: Joint positions, and run-time inputs in place of the robot's own limits.
    State = tuple[Array, dict[str, Array]]


def drawn_states(step: CompiledStep, count: int, seed: int) -> list[State]:
    """Draw states: joints anywhere, near their limits, on them; the robot's own limits and tighter ones in turns."""
    draws = Draws(step, np.random.default_rng(seed))
    found = []
    for _ in range(count):
        limits = draws.limits()
        found.append((draws.anywhere(1, limits).q[0], dict(limits)))
    return found


def read_state(path: Path, nv: int) -> State:
    """Read a state: what `kinqp worst-case` wrote, its state of most iterations; or {"q": [...], "limits": {...}}.

    Raises
    ------
    CaseError
        Naming the file, when it is neither or of another robot.
    """
    expected = f"{path}: expected a file of kinqp worst-case, or a state {{q: {nv} numbers, limits: {{name: numbers}}}}"
    try:
        given: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        given = given.get("most", given)
        q = np.array(given["q"], dtype=float)
        limits = {name: np.array(values, dtype=float) for name, values in given.get("limits", {}).items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CaseError(f"{expected}: {error}") from error
    if q.shape != (nv,):
        raise CaseError(f"{expected}, got q of shape {q.shape}")
    return q, limits
