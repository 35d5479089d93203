"""Constraints that keep a measured gap from closing: how fast it may shrink, and how a violated one recovers."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca
import numpy as np

from ...solvers.options import flag
from ..bounds import viable_bound
from .base import Constraint

if TYPE_CHECKING:
    from ..program import QuadraticProgram
    from ..tick import Tick

APPROACHES: Final = ("viable", "damper", "step")
# No gap of an arm closes this fast [m/s, rad/s, ...]; the viable bound wants a finite speed.
_FASTEST: Final = 1e3
# The hand is taken for guiding the arm, and retreats for wanted, well above this [m/s, rad/s].
_HAND_AT_REST: Final = 0.01


@dataclass(frozen=True)
class Gaps:
    """Gaps and how they change.

    Attributes
    ----------
    gap : ca.SX, shape (k, 1)
        Positive while the constraint holds.
    rows : ca.SX, shape (k, nv)
        `rows` @ qd is the gaps' rate, times `scale`.
    scale : ca.SX, shape (k, 1)
        Not negative; keeps rows finite where a rate is singular. All ones where rates are regular.
    """

    gap: ca.SX
    rows: ca.SX
    scale: ca.SX


@dataclass(frozen=True, kw_only=True)
class GapConstraint(Constraint):
    r"""Rows rate >= -b(gap), with b never negative, so that zero motion is always feasible.

    Where the gap is positive, b is one of

    - `viable`: the largest rate from which a deceleration of `deceleration` stops it at zero in sampled time,
      `kinqp.formulations.viable_bound`, of the house's joint limits;
    - `damper`: gain times gap, at most gap / dt: the velocity damper of Faverjon and Tournassoud, "A local based
      approach for path planning of manipulators with a high number of degrees of freedom", ICRA 1987, with gain
      :math:`\xi/(d_i - d_s)` and in force beyond the influence distance too, so that nothing jumps there;
    - `step`: gap / dt, the bound of the shared-control drilling robot, d + n'(J_i - J_j) dt qd >= r_i + r_j: the gap is
      used up within one period, whatever acceleration that takes.

    Where it is negative, b is zero: no further. The rows are linear, the gaps are not, so each period may lose up to
    half dt^2 times the gap's second derivative at constant qd. So that this does not add up while the hand slides along
    a bound, `retreat` asks for rate >= min(retreat_gain |gap|, retreat_max), times a factor that is zero while the hand
    is at rest: the arm never moves of itself. A share of it is given up where limits, locked rows or another constraint
    can't follow (the variable "<name> share", see `Constraint.share`), down to "no further". The loss then settles near
    c dt / (2 retreat_gain), with c that second derivative.

    Parameters
    ----------
    approach : {"viable", "damper", "step"}
        Which b.
    retreat : bool
        Whether violated gaps recover; without, no variable is added.

    Run-time parameters
    -------------------
    <name>_deceleration (viable), <name>_gain (damper) [1/s], <name>_retreat_gain [1/s], <name>_retreat_max,
    <name>_priority
    """

    approach: str = "viable"
    retreat: bool = True

    unit: ClassVar[str]
    default_deceleration: ClassVar[float]
    default_gain: ClassVar[float]
    default_retreat: ClassVar[float]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.approach not in APPROACHES:
            raise ValueError(f"{self.kind}, approach: expected one of {', '.join(APPROACHES)}, got {self.approach!r}")
        object.__setattr__(self, "retreat", flag("retreat", self.retreat))

    @abstractmethod
    def gaps(self, tick: Tick) -> Gaps:
        """Measure the gaps."""

    def add(self, qp: QuadraticProgram, tick: Tick) -> None:
        """Add one row for each gap, and the share of their retreat."""
        measured = self.gaps(tick)
        if not measured.gap.size1():
            return
        rate = self.rate_of(qp, measured.rows)
        lower = -measured.scale * self._closing_bound(tick, measured.gap)
        if self.retreat:
            back = measured.scale * self._retreat_rate(tick, measured.gap)
            rate -= back * self.share(qp, tick)
        qp.between(lower, rate, np.inf, name=self.name)

    def _closing_bound(self, tick: Tick, gap: ca.SX) -> ca.SX:
        ahead = ca.fmax(gap, 0)
        if self.approach == "step":
            return ahead / tick.dt
        if self.approach == "damper":
            gain = self.parameter(tick, "gain", self.default_gain, unit="1/s", positive=True)
            return ahead * ca.fmin(gain, 1 / tick.dt)
        deceleration = self.parameter(
            tick, "deceleration", self.default_deceleration, unit=f"{self.unit}/s^2", positive=True
        )
        return viable_bound(ahead, ca.SX(_FASTEST), deceleration, tick.dt)

    def _retreat_rate(self, tick: Tick, gap: ca.SX) -> ca.SX:
        gain = self.parameter(tick, "retreat_gain", 50.0, unit="1/s", positive=True)
        most = self.parameter(tick, "retreat_max", self.default_retreat, unit=f"{self.unit}/s", not_negative=True)
        speed = ca.sqrt(ca.sumsqr(tick.v))
        guided = speed / (speed + _HAND_AT_REST)
        return guided * ca.fmin(ca.fmin(gain, 1 / tick.dt) * ca.fmax(-gap, 0), most)
