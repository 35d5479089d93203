"""`singularity`: manipulability that stays above a bound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca

from ..algebra import balanced_sum, matmul
from .gaps import GapConstraint, Gaps

if TYPE_CHECKING:
    from ..tick import Tick

ROWS: Final = ("all", "position", "guided")
# Added to the squared singular values, so that neither the measure nor its gradient is ever undefined. At a smallest
# singular value of 0.05 it makes the measure larger by 2e-6 of itself.
_SHIFT: Final = 1e-8
# Gradients of the measures are of the size of the arm; one above this is that of a jump, or rounding [1/rad or 1/m].
_STEEPEST: Final = 30.0
# At a singularity the shift leaves a gradient below this, which points anywhere but out of it.
_FLATTEST: Final = 1e-3


@dataclass(frozen=True, kw_only=True)
class SingularityAvoidance(GapConstraint):
    r"""Linearised bound on the manipulability.

    .. math:: \nabla w'\,\dot q \ge -b(w - w_{min}), \qquad w = \sqrt{\det(J J' + \mu I)}

    w is the product of the singular values of J: Yoshikawa, "Manipulability of robotic mechanisms", IJRR 1985, with
    :math:`\mu` = 1e-8 so that it has a gradient everywhere. The shared-control drilling robot names the subtask
    ("singularity avoidance") without a formula; with `approach="step"` this is w + grad w' qd dt >= w_min.

    Below the bound w may not fall further. At the singularity itself, within some 1e-6 of it in the smallest singular
    value, the gradient vanishes, and the row is left out. Units are mixed as the Jacobian's are, so the bound is chosen
    per arm: over all six rows, the LBR Med 14 has a median w of 0.065 over its joint ranges, the UR5e of 0.013.

    Parameters
    ----------
    rows : {"all", "position", "guided"}
        Which J: all six rows; the three translations; or the guided rows within the null space of the locked ones,
        J_bar, which also sees algorithmic singularities. That measure jumps where the locked rows themselves lose rank;
        close to there its gradient is no guide, and the row is dropped where it exceeds 30.

    Run-time parameters
    -------------------
    <name>_w_min
        The bound, 0.02 unless told otherwise [product of m and rad].
    """

    rows: str = "all"

    kind: ClassVar[str] = "singularity"
    unit: ClassVar[str] = "-"
    default_deceleration: ClassVar[float] = 0.5
    default_gain: ClassVar[float] = 5.0
    default_retreat: ClassVar[float] = 0.01
    default_priority: ClassVar[float] = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rows not in ROWS:
            raise ValueError(f"{self.kind}, rows: expected one of {', '.join(ROWS)}, got {self.rows!r}")

    def gaps(self, tick: Tick) -> Gaps:
        """Measure the manipulability."""
        measure = manipulability(self.jacobian(tick))
        bound = self.parameter(tick, "w_min", 0.02, unit="product of m and rad", positive=True)
        gradient = ca.jacobian(measure, tick.q)
        steepness = ca.sumsqr(gradient)
        usable = ca.logic_and(steepness > _FLATTEST**2, steepness < _STEEPEST**2)
        return Gaps(measure - bound, ca.if_else(usable, gradient, 0), ca.SX.ones(1, 1))

    def jacobian(self, tick: Tick) -> ca.SX:
        """Give the rows whose singular values count."""
        if self.rows == "guided":
            return tick.J_bar
        return tick.kinematics.jacobian if self.rows == "all" else tick.kinematics.jacobian[:3, :]


def manipulability(J: ca.SX) -> ca.SX:
    """Product of the singular values of J, shape (m, nv), each raised as in `SingularityAvoidance`; a positive scalar.

    With fewer columns than rows it is the product over the columns.
    """
    gram = matmul(J, J.T) if J.size1() <= J.size2() else matmul(J.T, J)
    return ca.sqrt(_determinant_of_positive(gram + _SHIFT * ca.SX.eye(gram.size1())))


def _determinant_of_positive(matrix: ca.SX) -> ca.SX:
    """Determinant of a symmetric positive definite matrix: the product of the pivots of L D L'."""
    m = matrix.size1()
    lower = ca.SX.eye(m)
    scaled: list[list[ca.SX]] = []
    product = ca.SX(1)
    for j in range(m):
        column = [matrix[i, j] - balanced_sum([lower[i, k] * scaled[k][j] for k in range(j)]) for i in range(m)]
        # Positive but for rounding, which at a singularity is 1e-16 beside the shift.
        pivot = ca.fmax(column[j], _SHIFT * 1e-3)
        scaled.append(column)
        product = product * pivot
        for i in range(j + 1, m):
            lower[i, j] = column[i] / pivot
    return product
