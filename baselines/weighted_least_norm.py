"""`weighted-least-norm`: joints are the more reluctant the closer they come to a limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ..formulations import limit_gradient
from .base import Baseline, Promise, Resolved
from .linear import prioritise

if TYPE_CHECKING:
    import casadi as ca

    from ..formulations import Tick
    from .situation import Situation


@dataclass(frozen=True)
class WeightedLeastNorm(Baseline):
    r"""Least norm weighted by how close joints are to their limits (thesis eq. 3.4-3.6; Chan and Dubey, T-RA 1995).

    .. math::
        \dot q = W^{-1} J' (J W^{-1} J')^{-1}\,\dot x,\qquad
        w_i = \begin{cases} 1 + |\partial H/\partial q_i| & \Delta|\partial H/\partial q_i| \ge 0 \\ 1 & \text{else}
        \end{cases}

    with :math:`H = \sum_i (q_{max,i} - q_{min,i})^2 / (4\,(q_{max,i} - q_i)(q_i - q_{min,i}))`, whose slope grows with
    motion towards the nearer limit. Here the locked rows come before the hand's in the weighted coordinates
    :math:`W^{1/2} \dot q`, which is the same where both can be met, and keeps the locked rows where they can't.

    Delta is judged by the last command `qd_prev`. A joint that rested is judged by what the unweighted least norm would
    have it do: left at Delta = 0 it would be weighted, and one that rests on its limit, where w is infinite, would stay
    there for ever. At a limit and beyond it the weight is infinite, and the joint does not move.

    As long as self-motion can do without the joint, it comes to rest in front of its limit. Where the task needs it,
    finite weights do not slow it down: it runs up to the limit, past it by up to one period's way, and stops at once.
    """

    name: ClassVar[str] = "weighted-least-norm"
    promises: ClassVar[frozenset[Promise]] = frozenset({"locked rows"})

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:
        """Last command, position limits, and the slope of H."""
        _ = tick.qd_prev
        return {"slope": limit_gradient(tick.q, tick.q_min, tick.q_max)}

    def resolve(self, at: Situation) -> Resolved:
        """Compute the command."""
        slope, last = at.extras["slope"][:, 0], at.inputs["qd_prev"]
        above, below = at.q >= at.inputs["q_max"], at.q <= at.inputs["q_min"]
        side = np.where(above, 1.0, np.where(below, -1.0, np.sign(slope)))
        resting = last == 0.0
        heading = np.where(resting, prioritise(at.tasks, np.eye(at.nv)).qd, last) if resting.any() else last
        towards = heading * side >= 0.0
        inverse = np.where(towards, np.where(above | below, 0.0, 1.0 / (1.0 + np.abs(slope))), 1.0)
        root = np.sqrt(inverse)
        tasks = [(J * root, xd) for J, xd in at.tasks]
        return Resolved(root * prioritise(tasks, np.eye(at.nv)).qd, 1, np.where(inverse == 0.0, side, 0.0))
