"""`task-augmentation`: joints at their bounds become rows of the task, with no order among the rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from .base import Baseline, Promise, Resolved
from .linear import factor

if TYPE_CHECKING:
    import casadi as ca

    from ..formulations import Tick
    from .situation import Situation

# A joint this little above its bound gets no row [rad/s or m/s]: it is rounding.
_OVER: Final = 1e-12


@dataclass(frozen=True)
class TaskAugmentation(Baseline):
    r"""Joint rate constraints as further rows of the task, all solved at once (thesis eq. 3.3).

    .. math::
        \begin{bmatrix} \dot x_E \\ \dot x_C \end{bmatrix} = \begin{bmatrix} J_E \\ J_C \end{bmatrix} \dot q,\qquad
        \dot q = J^\dagger \dot x

    E are the locked and the guided rows; C are the joints that would exceed their bounds, each to move at its bound
    (Chiacchio et al., IJRR 1991; Sciavicco and Siciliano, 1988; Baron 2000 treat limits so). The joint that exceeds its
    bound the most is added first, then the system is solved again, until no other does.

    There is no order of priority. As long as the rows are independent all hold; where they are not (the algorithmic
    singularities of Baillieul 1985), least squares spreads the error over all of them: **the locked rows are lost
    too**, and the bounds are exceeded.

    Run-time parameters
    -------------------
    limit_weight : shape ()
        Weight of a joint's row in the least squares beside 1 of the others, 1 unless told otherwise.
    """

    name: ClassVar[str] = "task-augmentation"
    promises: ClassVar[frozenset[Promise]] = frozenset()

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:
        """Weight of the joints' rows."""
        _ = tick.parameter("limit_weight", 1.0, lowest=0.0, positive=True)
        return {}

    def resolve(self, at: Situation) -> Resolved:
        """Compute the command."""
        J_E, x_E = np.vstack((at.J_fixed, at.J_free)), np.concatenate((at.v_fixed, at.v))
        weight = float(np.sqrt(at.inputs["limit_weight"][0]))
        held = np.zeros(at.nv)
        for _ in range(at.nv + 1):
            rows = held != 0.0
            x_C = np.where(held > 0.0, at.qd_hi, at.qd_lo)[rows]
            J = np.vstack((J_E, weight * np.eye(at.nv)[rows]))
            qd = factor(J).solve(np.concatenate((x_E, weight * x_C)))
            over = np.where(rows, 0.0, at.over(qd, _OVER))
            worst = int(np.argmax(over))
            if over[worst] <= 0.0:
                break
            held[worst] = 1.0 if qd[worst] > at.qd_hi[worst] else -1.0
        return Resolved(qd, 1 + int(np.count_nonzero(held)), held)
