"""`gradient-projection`: self-motion improves a criterion, in the null space of the tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from .base import Baseline, Promise, Resolved
from .criteria import CRITERIA, criterion_ingredients
from .linear import prioritise

if TYPE_CHECKING:
    import casadi as ca

    from ..formulations import Tick
    from .situation import Situation


@dataclass(frozen=True)
class GradientProjection(Baseline):
    r"""Least norm plus k times a criterion's gradient in the null space (thesis eq. 3.1; Liegeois 1977).

    .. math:: \dot q = J^\dagger \dot x + (I - J^\dagger J)\,z,\qquad z = \pm k\,\nabla h

    with the locked rows before the hand's, and uphill or downhill as the criterion wants. Limits are no part of it: k
    is all that can be set, and what joints then do is not checked.

    Parameters
    ----------
    criterion : {"joint-limits", "joint-velocity", "manipulability", "obstacle-distance"}
        h; see `kinqp.baselines.criteria`.

    Run-time parameters
    -------------------
    gain : shape ()
        k, 1 unless told otherwise: [1/s] for the joints' criteria ([-] for their velocities), and what takes the
        gradient of h to a joint velocity for the others.
    criterion_weight : shape (nv,)
        W's diagonal in the joints' criteria, 1 unless told otherwise.
    obstacle : shape (3,)
        Point to keep away from, in the world; infinite, as it is unless told otherwise, is none [m].
    """

    criterion: str = "joint-limits"

    name: ClassVar[str] = "gradient-projection"
    promises: ClassVar[frozenset[Promise]] = frozenset({"locked rows"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.criterion not in CRITERIA:
            raise ValueError(f"criterion: expected one of {', '.join(CRITERIA)}, got {self.criterion!r}")

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:
        """Gain, and what the criterion needs."""
        _ = tick.parameter("gain", 1.0, lowest=0.0)
        return criterion_ingredients(self.criterion, tick)

    def resolve(self, at: Situation) -> Resolved:
        """Compute the command."""
        tasks = prioritise(at.tasks, np.eye(at.nv))
        z = at.inputs["gain"][0] * CRITERIA[self.criterion](at, tasks.qd)
        return Resolved(tasks.qd + tasks.null @ (tasks.null.T @ z))
