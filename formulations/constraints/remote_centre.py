"""`remote-centre`: the tool's shaft passes through a point of the world, with drift correction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca

from ..algebra import dot, matmul
from .base import Constraint, limited

if TYPE_CHECKING:
    from ..program import QuadraticProgram
    from ..tick import Tick

# Of the pivot of recorded ticks behind the tip [m].
_EXAMPLE_DEPTH: Final = 0.1


@dataclass(frozen=True, kw_only=True)
class RemoteCentre(Constraint):
    r"""Remote centre of motion at a pivot in the world: the shaft slides and turns through it, and never leaves it.

    With the tool's axes x, y, z (z along the shaft), its tip p, the pivot r, the depth :math:`d = z'(r - p)` of the
    pivot along the shaft and the error :math:`e = (x'(r - p),\ y'(r - p))`, two equalities:

    .. math:: (x, y)'(J_{lin} - d\,[z]_\times J_{ang})\,\dot q = s\,c(e)

    The left side is the sideways velocity of the point of the shaft beside the pivot, the right side a correction of
    drift: gain times error, limited to `speed`, times the share s in [0, 1] of it that is carried out. These are the
    equality constraints of the shared-control drilling robot, S'J qd = e with "e an adjustable error term for drift
    compensation". Limits that can't follow a correction would make that rule infeasible; here the correction gives
    way, by the variable "<name> share" at a cost of 1/2 priority (1 - s)^2, and at zero the sideways motion is zero:
    zero motion is always feasible.

    `Mode.rcm(depth)` locks the same two rows at a fixed depth, whatever point of the world that is; at d = depth they
    are equal. This constraint fixes the pivot and lets the depth follow. So it goes with modes that leave these rows to
    the hand: `free`, `position`; with `fix-orientation` what is left is the insertion. On top of `rcm` with another
    depth two points of the shaft are held, and all that is left is insertion and roll.

    Parameters
    ----------
    pivot : sequence of 3 float, or text of three numbers, optional
        Default of the run-time parameter, world [m]; without it every call must give it.

    Run-time parameters
    -------------------
    <name>_pivot : shape (3,)
        World [m].
    <name>_gain, <name>_speed, <name>_priority
        Of the correction [1/s], [m/s]: 10 and 0.02 unless told otherwise.
    """

    pivot: tuple[float, float, float] | str | None = None

    kind: ClassVar[str] = "remote-centre"

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.pivot, str):
            # Blanks between the numbers, since commas separate options on the command line.
            object.__setattr__(self, "pivot", _numbers(self.pivot))
        elif self.pivot is not None:
            object.__setattr__(self, "pivot", tuple(float(value) for value in self.pivot))
        if self.pivot is not None and len(self.pivot) != 3:
            raise ValueError(f"{self.name}, pivot: expected 3 numbers, got {self.pivot}")

    def add(self, qp: QuadraticProgram, tick: Tick) -> None:
        """Add the two equalities."""
        default = None if self.pivot is None else [*map(float, self.pivot)]
        on_shaft = tick.pose[:3, 3] - _EXAMPLE_DEPTH * tick.pose[:3, 2]
        pivot = self.parameter(tick, "pivot", default, size=3, unit="m", example=on_shaft)
        gain = self.parameter(tick, "gain", 10.0, unit="1/s", not_negative=True)
        speed = self.parameter(tick, "speed", 0.02, unit="m/s", not_negative=True)
        rows, error = shaft(tick, pivot)
        back = limited(ca.fmin(gain, 1 / tick.dt) * error, speed)
        sideways = self.rate_of(qp, rows)
        qp.equal(sideways - back * self.share(qp, tick), 0.0, name=self.name)


def shaft(tick: Tick, pivot: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Give the rows of the shaft's sideways velocity beside a pivot, (2, nv), and the pivot's offset, (2, 1) [m]."""
    pose, J = tick.pose, tick.kinematics.jacobian
    sideways, z = pose[:3, :2].T, pose[:3, 2]
    ahead = pivot - pose[:3, 3]
    lever = dot(z, ahead) * z
    rows = matmul(sideways, J[:3, :]) - matmul(matmul(sideways, ca.skew(lever)), J[3:, :])
    return rows, matmul(sideways, ahead)


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split())
    except ValueError:
        raise ValueError(f"pivot: expected three numbers as in '0.5 0 0.3', got {text!r}") from None
