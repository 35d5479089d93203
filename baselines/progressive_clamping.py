"""`progressive-clamping`: each joint by itself is damped on its way into a limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from .base import Baseline, Promise, Resolved
from .linear import prioritise

if TYPE_CHECKING:
    import casadi as ca

    from ..formulations import Tick
    from .situation import Situation


@dataclass(frozen=True)
class ProgressiveClamping(Baseline):
    r"""Joints damped one by one, in a zone before their limits (thesis eq. 3.10; Raunhardt and Boulic, 2007).

    .. math::
        \dot q_i = (1 - h)\,\dot q_{0,i},\qquad h = \begin{cases} 1 & q_i + \dot q_{0,i}\,dt \text{ is beyond a limit}
        \\ 3 d^2 - 2 d^3 & q_i \text{ is in the zone and moves on into it} \\ 0 & \text{else} \end{cases}

    with d from 0 where the zone begins to 1 at the limit, and :math:`\dot q_0` of locked rows and hand by priority.
    (The thesis prints the first case with the lower limit twice; the second one is the upper.) Joints are treated
    singly, so that the others go on as if nothing had happened: **the locked rows are lost wherever a joint is
    damped.** Velocity limits are no part of it.

    Run-time parameters
    -------------------
    zone : shape ()
        Width of the zone as a share of the joint's range, 0.05 unless told otherwise.
    """

    name: ClassVar[str] = "progressive-clamping"
    promises: ClassVar[frozenset[Promise]] = frozenset()

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:
        """Position limits and the zone."""
        _ = tick.q_min, tick.q_max, tick.parameter("zone", 0.05, lowest=0.0, positive=True)
        return {}

    def resolve(self, at: Situation) -> Resolved:
        """Compute the command."""
        qd = prioritise(at.tasks, np.eye(at.nv)).qd
        low, high = at.inputs["q_min"], at.inputs["q_max"]
        up = qd > 0.0
        # Of a joint with one limit the zone has no width: only the first case is left.
        width = at.inputs["zone"][0] * np.where(at.limited, high - low, 0.0)
        distance = np.where(up, high - at.q, at.q - low)
        with np.errstate(invalid="ignore", divide="ignore"):
            d = np.clip(np.where(width > 0.0, 1.0 - distance / width, 0.0), 0.0, 1.0)
        beyond = distance < np.abs(qd) * at.dt
        h = np.where(beyond, 1.0, d * d * (3.0 - 2.0 * d))
        damped = (h > 0.0) & (qd != 0.0)
        return Resolved((1.0 - h) * qd, 1, np.where(damped, np.where(up, 1.0, -1.0), 0.0))
