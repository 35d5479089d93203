"""`task-priority`: the locked rows, then the hand, then a posture; a joint that would pass its limit is frozen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from .base import Baseline, Promise, Resolved
from .linear import prioritise
from .posture import check_gain, with_posture

if TYPE_CHECKING:
    import casadi as ca

    from ..formulations import Tick
    from .situation import Situation

LIMITS = ("hard-stop", "none")


@dataclass(frozen=True)
class TaskPriority(Baseline):
    r"""Tasks in strict order (thesis eq. 3.2), joints frozen at their position limits (the thesis's algorithm A).

    .. math:: \dot q_i = \dot q_{i-1} + (J_i P^A_{i-1})^\dagger (\dot x_i - J_i\,\dot q_{i-1})

    for the locked rows, the hand's rows (4.2.2) and, with `posture_gain`, a posture. As the thesis describes the
    solution that it starts from (2.2.1), a joint whose next position would lie beyond a position limit is frozen, all
    others move on. It says that the joint's *row* of the Jacobian is set to zero; rows belong to the task, and freezing
    a joint means its **column**, in the locked rows as well, so that these still hold. Whether another joint passes its
    limit for that is asked again, until none does. After Siciliano and Slotine (ICAR 1991).

    Velocity and acceleration limits are no part of it: joints stop and start at once, with v/dt.

    Parameters
    ----------
    limits : {"hard-stop", "none"}
        "none" is eq. 3.2 alone.
    posture_gain : float
        k [1/s] of a third task -k (q - middle of the range), for the joints that have limits; 0: no such task.
    """

    limits: str = "hard-stop"
    posture_gain: float = 0.0

    name: ClassVar[str] = "task-priority"
    promises: ClassVar[frozenset[Promise]] = frozenset({"locked rows"})

    def __post_init__(self) -> None:
        super().__post_init__()
        check_gain(self.posture_gain)
        if self.limits not in LIMITS:
            raise ValueError(f"limits: expected one of {', '.join(LIMITS)}, got {self.limits!r}")

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:
        """Position limits."""
        _ = tick.q_min, tick.q_max
        return {}

    def resolve(self, at: Situation) -> Resolved:
        """Compute the command."""
        tasks = with_posture(at, self.posture_gain)
        held = np.zeros(at.nv)
        passes = 0
        sigma_min = None
        for _ in range(at.nv + 1):
            passes += 1
            found = prioritise(tasks, np.eye(at.nv)[:, held == 0.0])
            qd = found.qd
            if passes == 1:
                sigma_min = found.factors[1].smallest()
            if self.limits == "none":
                break
            ahead = at.q + at.dt * qd
            beyond = np.where((ahead > at.inputs["q_max"]) & (qd > 0.0), 1.0, 0.0)
            beyond -= np.where((ahead < at.inputs["q_min"]) & (qd < 0.0), 1.0, 0.0)
            if not beyond.any():
                break
            held = np.where(held == 0.0, beyond, held)
        return Resolved(qd, passes, held, sigma_min)
