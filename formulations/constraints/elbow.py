"""`elbow`: the arm angle of a seven-axis arm held, or kept within a range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca
import numpy as np

from ...solvers.options import flag
from .arm_angle import ArmAngle, arm_angle, find_centres
from .base import Constraint, limited, unit_or_zero
from .gaps import GapConstraint, Gaps

if TYPE_CHECKING:
    from ..program import QuadraticProgram
    from ..tick import Tick


# A correction of the elbow is a matter of self-motion: giving it up costs as much as 0.03 m/s of the hand, so that it
# goes on where self-motion is to be had, and does not push the hand about where it is not (`cartesian-error`).
_BELOW_THE_HAND: Final = 1e-3


@dataclass(frozen=True, kw_only=True)
class ElbowHold(Constraint):
    r"""No self-motion: the arm angle stays where it is, or goes to where it should be (thesis 2.3.2).

    The thesis lists "Elbow motion restriction (singularities avoidance)" among the features of the hand-guiding
    module, and gives no formula. Here it is the equality

    .. math:: m\,\dot\psi = s\,m\,c(\psi_{ref} - \psi)

    with the arm angle :math:`\psi` of `kinqp.formulations.constraints.arm_angle`, m the factor that keeps its rate
    finite, c gain times difference, limited to `speed`, and s in [0, 1] the share of the correction. Zero motion
    with s = 0 is always feasible: where limits or locked rows can't follow a correction, it is given up, and the
    angle still never moves away. The price is the thesis's "slide along the joint limit": with six rows guided or
    locked a seven-axis arm has no freedom left, and a joint on its limit then takes guided directions away. Use
    `ElbowRange` where it may.

    Without `correct` there is no correction and no s: the rate is zero, and drift stays as it comes.

    The angle is undefined where shoulder, elbow and wrist are in line (arm stretched), and where shoulder and wrist
    are in line with the reference direction. The row goes to zero there with m. An arm that is guided through the
    stretched posture comes out with its angle turned by 180 deg: without `correct` that is where it is held from then
    on, with it the elbow is swung round at `speed`. `ElbowBend` keeps the arm from getting there.

    Parameters
    ----------
    correct : bool
        Whether the angle is led to `<name>_angle`, and not only held.
    angle : float, optional
        Default of the run-time parameter [rad]; without it every call must give it.

    Run-time parameters
    -------------------
    <name>_angle : shape (1,)
        Where the angle should be [rad], with `correct`.
    <name>_gain, <name>_speed, <name>_priority
        Of the correction [1/s], [rad/s]: 5 and 0.2 unless told otherwise.
    <name>_reference : shape (3,)
        Direction from which the angle counts, world axes; the vertical unless told otherwise.
    """

    correct: bool = False
    angle: float | None = None

    kind: ClassVar[str] = "elbow-hold"
    default_priority: ClassVar[float] = _BELOW_THE_HAND

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "correct", flag("correct", self.correct))
        if self.angle is not None and not (self.correct and np.isfinite(self.angle)):
            raise ValueError(f"{self.kind}, angle: expected a finite number, and correct=true, got {self.angle}")

    def add(self, qp: QuadraticProgram, tick: Tick) -> None:
        """Add the equality."""
        angle = _arm_angle(self, tick)
        rate = self.rate_of(qp, angle.row)
        if not self.correct:
            qp.equal(rate, 0.0, name=self.name)
            return
        here = ca.atan2(angle.sine, angle.cosine)
        away = _difference(angle, self.parameter(tick, "angle", self.angle, unit="rad", example=here))
        gain = self.parameter(tick, "gain", 5.0, unit="1/s", not_negative=True)
        speed = self.parameter(tick, "speed", 0.2, unit="rad/s", not_negative=True)
        back = -limited(ca.fmin(gain, 1 / tick.dt) * away, speed) * angle.scale
        qp.equal(rate - back * self.share(qp, tick), 0.0, name=self.name)


@dataclass(frozen=True, kw_only=True)
class ElbowRange(GapConstraint):
    r"""The arm angle kept within a range about a centre (thesis 2.3.2, see `ElbowHold`).

    .. math:: -m\,b(\psi - \psi_{ref} + w) \le m\,\dot\psi \le m\,b(w - (\psi - \psi_{ref}))

    with the difference of angles taken within +-180 deg, and b never negative: see `GapConstraint`. Outside the range
    the angle may not go further out. Where the angle is undefined, see `ElbowHold`, both rows are zero.

    Run-time parameters
    -------------------
    <name>_angle
        Centre of the range [rad]; 0 unless told otherwise: the elbow on the side of the reference direction.
    <name>_width
        Half of the range [rad]; 60 deg unless told otherwise.
    <name>_reference : shape (3,)
        As in `ElbowHold`.
    """

    kind: ClassVar[str] = "elbow-range"
    unit: ClassVar[str] = "rad"
    default_deceleration: ClassVar[float] = 5.0
    default_gain: ClassVar[float] = 5.0
    default_retreat: ClassVar[float] = 0.2
    default_priority: ClassVar[float] = _BELOW_THE_HAND

    def gaps(self, tick: Tick) -> Gaps:
        """Measure what is left to either side, the upper first."""
        angle = _arm_angle(self, tick)
        away = _difference(angle, self.parameter(tick, "angle", 0.0, unit="rad"))
        width = self.parameter(tick, "width", float(np.deg2rad(60.0)), unit="rad", not_negative=True)
        return Gaps(
            ca.vertcat(width - away, width + away),
            ca.vertcat(-angle.row, angle.row),
            ca.vertcat(angle.scale, angle.scale),
        )


@dataclass(frozen=True, kw_only=True)
class ElbowBend(GapConstraint):
    r"""The elbow kept off the line through shoulder and wrist: the arm never stretches, its angle stays defined.

    .. math:: \hat p'(J_e - \tfrac{\hat w'e}{|w|} J_w)\,\dot q \ge -b(|p| - p_{min})

    with p the elbow's offset from that line. Zero motion is always feasible, see `GapConstraint`; the singularity that
    the thesis's elbow restriction is there for (2.3.2) is then out of reach. An arm that starts stretched has a row of
    zeros: it may bend.

    Run-time parameters
    -------------------
    <name>_min
        Least offset [m]; 0.05 unless told otherwise: the LBR Med 14 then stops 14 deg short of stretched.
    """

    kind: ClassVar[str] = "elbow-bend"
    unit: ClassVar[str] = "m"
    default_deceleration: ClassVar[float] = 2.0
    default_gain: ClassVar[float] = 5.0
    default_retreat: ClassVar[float] = 0.05
    default_priority: ClassVar[float] = _BELOW_THE_HAND

    def gaps(self, tick: Tick) -> Gaps:
        """Measure the elbow's offset."""
        angle = _arm_angle(self, tick)
        least = self.parameter(tick, "min", 0.05, unit="m", not_negative=True)
        return Gaps(angle.offset - least, angle.offset_row, ca.SX.ones(1, 1))


def _arm_angle(constraint: Constraint, tick: Tick) -> ArmAngle:
    reference = constraint.parameter(tick, "reference", [0.0, 0.0, 1.0], size=3, unit="-")
    return arm_angle(tick.kinematics, find_centres(tick.robot), unit_or_zero(reference))


def _difference(angle: ArmAngle, reference: ca.SX) -> ca.SX:
    """How far the angle is from a reference, within +-pi [rad]; zero where the angle is undefined."""
    cosine, sine = ca.cos(reference), ca.sin(reference)
    return ca.atan2(angle.sine * cosine - angle.cosine * sine, angle.cosine * cosine + angle.sine * sine)
