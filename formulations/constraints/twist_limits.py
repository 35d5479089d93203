"""`twist-limits`: a box around the tool's twist."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca

from ..algebra import matmul
from .base import Constraint

if TYPE_CHECKING:
    from ..program import QuadraticProgram
    from ..tick import Tick

FRAMES: Final = ("world", "tool", "mode")
# Reduced speed of the tool while a person guides the robot (ISO 10218-1:2011, 5.6.2) [m/s].
_REDUCED_SPEED: Final = 0.25
# No standard has one for turning: this project's choice, 0.25 m/s at 0.17 m from the axis [rad/s].
_REDUCED_TURN: Final = 1.5


@dataclass(frozen=True, kw_only=True)
class TwistLimits(Constraint):
    r"""Limits on the tool's linear and angular velocity, each axis for itself.

    .. math:: -\ell \le J_{frame}\,\dot q \le \ell

    Named by the shared-control drilling robot among its linear constraints ("spatial velocity limits"). A box, not a
    ball: along a diagonal the speed may be sqrt(3) times the limit, so divide the limit by sqrt(3) where the norm
    counts. Zero motion is inside, since limits are not negative.

    Parameters
    ----------
    frame : {"world", "tool", "mode"}
        Whose axes. `mode` counts along the mode's axes, and in `rcm` at its pivot; the other two at the tool centre
        point.

    Run-time parameters
    -------------------
    <name>_linear : shape (3,)
        [m/s], 0.25 unless told otherwise (ISO 10218-1, reduced speed); infinite: none.
    <name>_angular : shape (3,)
        [rad/s], 1.5 unless told otherwise; infinite: none.
    """

    frame: str = "world"

    kind: ClassVar[str] = "twist-limits"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.frame not in FRAMES:
            raise ValueError(f"{self.kind}, frame: expected one of {', '.join(FRAMES)}, got {self.frame!r}")

    def add(self, qp: QuadraticProgram, tick: Tick) -> None:
        """Add six rows, translations first."""
        linear = self.parameter(
            tick, "linear", _REDUCED_SPEED, size=3, unit="m/s", not_negative=True, may_be_infinite=True
        )
        angular = self.parameter(
            tick, "angular", _REDUCED_TURN, size=3, unit="rad/s", not_negative=True, may_be_infinite=True
        )
        most = ca.vertcat(linear, angular)
        qp.between(-most, self.rate_of(qp, self._rows(tick)), most, name=self.name)

    def _rows(self, tick: Tick) -> ca.SX:
        if self.frame == "mode":
            return tick.J
        jacobian = tick.kinematics.jacobian
        if self.frame == "world":
            return jacobian
        to_tool = tick.pose[:3, :3].T
        return ca.vertcat(matmul(to_tool, jacobian[:3, :]), matmul(to_tool, jacobian[3:, :]))
