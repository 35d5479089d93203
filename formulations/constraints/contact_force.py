"""`contact-force`: the force of a stiff contact at the tool that stays below a bound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca

from ..algebra import matmul
from .base import unit_or_zero
from .gaps import GapConstraint, Gaps

if TYPE_CHECKING:
    from ..tick import Tick


@dataclass(frozen=True, kw_only=True)
class ContactForce(GapConstraint):
    r"""Bound on the force with which the tool presses on a surface of known stiffness.

    Pressing further by a velocity along the pressing direction p raises the force by stiffness times velocity:

    .. math:: k\,p'J_{lin}\,\dot q \le b(f_{max} - f)

    The shared-control drilling robot names the subtask ("contact force constraint") without a formula. With
    `approach="step"` it is f + k p'J qd dt <= f_max. The default, the damper, is the admittance of its "Admittance
    Control" section without mass: p'J qd <= (f_max - f) / B, with damping B = stiffness / gain. Above the bound the
    tool may not press further, and gives way while the hand guides it (see `GapConstraint`).

    The force is measured and the normal known; while there is no contact, leave the normal zero, and the row is none.

    Run-time parameters
    -------------------
    <name>_normal : shape (3,)
        Direction in which the tool presses, into the surface, world axes, of any length; zero (no contact) unless told
        otherwise.
    <name>_now
        Force in that direction, on the surface [N]; 0 unless told otherwise.
    <name>_stiffness
        Of surface and tool in series [N/m]; 10,000 unless told otherwise.
    <name>_max
        [N]; 20 unless told otherwise.
    """

    approach: str = "damper"

    kind: ClassVar[str] = "contact-force"
    unit: ClassVar[str] = "N"
    default_deceleration: ClassVar[float] = 2e4
    default_gain: ClassVar[float] = 10.0
    default_retreat: ClassVar[float] = 100.0

    def gaps(self, tick: Tick) -> Gaps:
        """Measure what is left of the force."""
        normal = unit_or_zero(self.parameter(tick, "normal", 0.0, size=3, unit="-"))
        force = self.parameter(tick, "now", 0.0, unit="N")
        stiffness = self.parameter(tick, "stiffness", 1e4, unit="N/m", positive=True)
        most = self.parameter(tick, "max", 20.0, unit="N", not_negative=True)
        pressing = matmul(normal.T, tick.kinematics.jacobian[:3, :])
        # In metres, so that the row is of the size of the others: the force divided by the stiffness.
        contact = ca.if_else(ca.sumsqr(normal) > 0, 1, 0) / stiffness
        return Gaps(most - force, -pressing, contact)
