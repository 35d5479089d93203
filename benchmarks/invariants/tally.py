"""What is counted of a formulation, robot, mode and solver: states, refusals, and what was broken, with a state."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pydantic import BaseModel, Field, field_serializer

from ..json_numbers import with_words

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from .states import StateSet

    Array = NDArray[np.float64]

#: Every invariant by name: what its figure is.
INVARIANTS: Final[Mapping[str, str]] = {
    "finite": "states whose command or Cartesian error is not finite",
    "bounds": "excess over a joint velocity bound [rad/s or m/s], safe stops included",
    "locked rows": "error of a locked row, relative to the joints' share in it, at least 1 m/s or rad/s",
    "error": "difference of the error told and J_free qd - v, relative to the hand, at least 1 m/s or rad/s",
    "safe stop": "difference of a refused tick's command from the safe stop [rad/s or m/s]",
    "told": "refused ticks without a message",
    "residuals": "largest scaled residual of an answer that passed as solved",
    "cost": "cost above the best that any solver found, relative, at least 1",
    "nan": "inputs that are not finite and are not refused",
    "raised": "calls that raised",
    "repeat": "compiled: ticks that differ in a bit when repeated",
    "batch": "compiled: ticks of a batch that differ in a bit from a single call",
    "iterations": "compiled: iterations above the bound, of which this is the count",
    "parity": "compiled: difference from the interpreted command, relative, at least 1 rad/s; 1e-9 is allowed, or what "
    "either command moves by when the joints move by 1e-10",
    "apart": "the same difference, whatever the neighbours say",
    "compiled rows": "compiled: error of a row of the interpreted step's problem, relative to its terms, at least 1",
    "compiled cost": "compiled: cost in that problem above its answer's, relative to its terms and what a move costs",
    "unexplained": "compiled: states with parity or apart broken, neither worth as much nor within what rounding "
    "of the state does to the interpreted command",
    "cvxpy numbers": "difference of the declared objective in cvxpy, relative",
    "cvxpy answer": "difference in cost, or scaled primal residual, of the declared problem solved by cvxpy",
}


class Violation(BaseModel):
    """One invariant: how often it was broken, and the worst figure met.

    Attributes
    ----------
    count : int
        Zero: it held everywhere; `worst` then is the figure closest to what is allowed.
    worst : float
    allowed : float
        What was allowed at that state.
    index : int
        Number of that state; see `States`.
    kind : str
    state : dict
        Its `q`, `v`, `qd_prev` and `qdd_prev`.
    """

    count: int = 0
    worst: float = 0.0
    allowed: float = 0.0
    index: int = -1
    kind: str = ""
    state: dict[str, list[float]] = Field(default_factory=dict)

    @field_serializer("state", when_used="json")
    def _words_for_infinity(self, state: dict[str, list[float]]) -> dict[str, list[float | str]]:
        """JSON knows no infinity; as words they are read back as they were."""
        return {name: with_words(values) for name, values in state.items()}


class Row(BaseModel):
    """A cell's row in the results.

    Attributes
    ----------
    formulation, robot, mode, solver : str
    states : int
    skipped : str
        Why the cell can't be; empty where it was run.
    refused : dict of str to int
        Ticks that ended in the safe stop, by status.
    wrong_solved : int
        Of those, the ones of which the solver said "solved".
    notes : dict of str to int
        What is counted without being wrong: of compiled steps, commands further than 1e-9 from the interpreted ones
        where those move as far within 1e-10 rad, and ticks that only one of the two solved.
    checked : dict of str to Violation
        By name of invariant.
    cpu : float
        [s].
    """

    formulation: str
    robot: str
    mode: str
    solver: str
    states: int = 0
    skipped: str = ""
    refused: dict[str, int] = Field(default_factory=dict)
    wrong_solved: int = 0
    notes: dict[str, int] = Field(default_factory=dict)
    checked: dict[str, Violation] = Field(default_factory=dict)
    cpu: float = 0.0

    @property
    def violations(self) -> dict[str, Violation]:
        """The invariants that were broken."""
        return {name: one for name, one in self.checked.items() if one.count}

    def check(self, name: str, figures: ArrayLike, allowed: ArrayLike, states: StateSet, *, offset: int = 0) -> None:
        """Judge a figure of each state: more than is allowed, or NaN, breaks the invariant.

        Parameters
        ----------
        name : str
            Of `INVARIANTS`.
        figures : array_like, shape (N,)
        allowed : array_like, shape (N,) or ()
        states : StateSet
            As many, or more.
        offset : int
            Number of the first state.
        """
        if name not in INVARIANTS:
            raise ValueError(f"name: expected one of {', '.join(INVARIANTS)}, got {name!r}")
        figure = np.asarray(figures, dtype=float)
        limit = np.broadcast_to(np.asarray(allowed, dtype=float), figure.shape)
        known = self.checked.setdefault(name, Violation())
        if not figure.size:
            return
        broken = ~(figure <= limit)
        share = np.where(np.isnan(figure), np.inf, figure / np.maximum(limit, 1e-300))
        at = int(np.argmax(share))
        before = -1.0 if known.index < 0 else known.worst / max(known.allowed, 1e-300)
        if share[at] > before:
            worst = float(np.nan_to_num(figure[at], nan=1e300, posinf=1e300))
            number = at + offset
            self.checked[name] = known.model_copy(
                update={
                    "worst": worst,
                    "allowed": float(limit[at]),
                    "index": number,
                    "kind": states.kinds[number],
                    "state": state_at(states, number),
                }
            )
        self.checked[name].count += int(broken.sum())


def state_at(states: StateSet, index: int) -> dict[str, Any]:
    """One state's inputs, to the last bit."""
    return {name: getattr(states, name)[index].tolist() for name in ("q", "v", "qd_prev", "qdd_prev")}
