"""What a constraint is, and how it is put on top of a formulation."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import casadi as ca

from ..algebra import matmul
from ..base import Formulation
from ..program import DeclarationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from ..program import QuadraticProgram
    from ..tick import Tick


@dataclass(frozen=True, kw_only=True)
class Constraint(ABC):
    """Rows on the command that can be added to any formulation at velocity level.

    A subclass is a frozen dataclass: it gives `kind` and `add`, and its fields are its options. Numbers that a
    controller may want to change while it runs are run-time parameters, under the constraint's name with underscores
    (`self-collision` has `self_collision_margin`).

    Every constraint of this library leaves zero motion feasible, whatever the state, as long as `v_fixed` is zero:
    a bound that is violated already means "no further", never "back at once", and what corrects an error carries a
    share in [0, 1] that falls to zero where the limits can't follow. On a formulation that bounds the change of its
    command zero motion may itself be out of reach; there a constraint can make the QP infeasible.

    Parameters
    ----------
    name : str
        What its rows, variables and parameters are called, `kind` unless told otherwise. Two constraints of one kind
        need two names.
    """

    name: str = ""

    kind: ClassVar[str]
    # Above the hand, unless a subclass says otherwise: 1 m/s of Cartesian error costs as much as the whole correction.
    default_priority: ClassVar[float] = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.kind)
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9 _-]*", self.name):
            raise ValueError(f"name of {self.kind}: expected letters, digits, spaces and hyphens, got {self.name!r}")

    @abstractmethod
    def add(self, qp: QuadraticProgram, tick: Tick) -> None:
        """Add the rows.

        Parameters
        ----------
        qp : QuadraticProgram
            With the command declared; see `command_of`.
        tick : Tick
            The symbols of the control cycle.
        """

    def parameter(
        self,
        tick: Tick,
        suffix: str,
        default: float | Sequence[float] | NDArray[np.float64] | None,
        *,
        unit: str,
        size: int = 1,
        positive: bool = False,
        not_negative: bool = False,
        may_be_infinite: bool = False,
        example: ca.SX | None = None,
    ) -> ca.SX:
        """Return the symbol of a run-time parameter named after the constraint, shape (size, 1).

        Without a default, give an `example`, as `Tick.parameter` takes it: an export records its ticks with it.
        """
        prefix = re.sub(r"\W+", "_", self.name).lower()
        return tick.parameter(
            f"{prefix}_{suffix}",
            default,
            size=size,
            lowest=0.0 if positive or not_negative else -float("inf"),
            positive=positive,
            may_be_infinite=may_be_infinite,
            unit=unit,
            example=example,
        )

    def command_of(self, qp: QuadraticProgram) -> ca.SX:
        """Return the declared command, shape (nv, 1), affine in the variables."""
        if qp.command_expression is None:
            raise DeclarationError(f"{self.name}: expected a formulation that has declared its command, got none yet")
        return qp.command_expression

    def rate_of(self, qp: QuadraticProgram, rows: ca.SX) -> ca.SX:
        """Return rows @ command, shape (k, 1), affine in the variables, for rows of shape (k, nv).

        Coefficients that are nothing but rounding become zero, as they do in `kinqp.formulations.robust_inverse`: a row
        that can't take part in the motion would otherwise block half of all directions, in a random way, as soon as its
        bound is zero.
        """
        command = self.command_of(qp)
        rows = ca.sparsify(ca.if_else(ca.fabs(rows) > _ROUNDING, rows, 0))
        x = ca.vertcat(*qp.variables.values())
        K = ca.jacobian(command, x)
        if K.is_constant():
            return matmul(rows, command)
        slope = matmul(rows, K)
        noise = _ROUNDING * matmul(ca.fabs(rows), ca.fabs(K))
        kept = ca.sparsify(ca.if_else(ca.fabs(slope) > noise, slope, 0))
        offset = matmul(rows, ca.substitute(command, x, ca.SX.zeros(x.size1(), 1)))
        # What is left of a row without coefficients is rounding too, and would contradict a bound of zero.
        alive = ca.sum2(ca.fabs(kept)) > 0
        return matmul(kept, x) + ca.if_else(alive, offset, 0)

    def share(self, qp: QuadraticProgram, tick: Tick) -> ca.SX:
        """Declare how much of a correction is carried out, and return it: a scalar in [0, 1].

        What is given up costs 1/2 priority (1 - share)^2, with the run-time parameter `priority` in the units of the
        task's cost, so that giving up a whole correction costs as much as a Cartesian error of sqrt(priority) m/s. A
        share instead of a slack keeps the rows homogeneous: no rounding makes them contradict each other at zero
        motion.
        """
        label = f"{self.name} share"
        share = qp.variable(label, 1)
        priority = self.parameter(tick, "priority", self.default_priority, unit="m^2/s^2", positive=True)
        qp.minimize(1 - share, weight=priority, name=label)
        qp.between(0.0, share, 1.0, name=label)
        if qp.feasible_values:
            qp.feasible(**{label: 0.0})
        return share


@dataclass(frozen=True)
class Constrained(Formulation):
    """A formulation with constraints on its command; a formulation like any other.

    Parameters
    ----------
    formulation : Formulation
        What to constrain; its `bounds` and its safe stop are taken over.
    constraints : sequence of Constraint
        In the order in which their rows are added.
    """

    formulation: Formulation = field(kw_only=True)
    constraints: tuple[Constraint, ...] = field(kw_only=True)

    name: ClassVar[str] = "constrained"

    def __post_init__(self) -> None:
        object.__setattr__(self, "bounds", self.formulation.bounds)
        object.__setattr__(self, "safe_stop", self.formulation.safe_stop)
        object.__setattr__(self, "limits_acceleration", self.formulation.limits_acceleration)
        object.__setattr__(self, "constraints", tuple(self.constraints))
        super().__post_init__()
        names = [constraint.name for constraint in self.constraints]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"constraints: expected different names, got {', '.join(twice)} twice; pass name=...")

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle: the formulation's, then the constraints' rows."""
        self.formulation.declare(qp, tick)
        for constraint in self.constraints:
            constraint.add(qp, tick)


def limited(vector: ca.SX, most: ca.SX) -> ca.SX:
    """Shorten a vector to a length of at most `most`, keeping its direction."""
    length = ca.sqrt(ca.sumsqr(vector))
    # Divided only where it is too long, so that a zero vector stays one.
    too_long = length > most
    return vector * ca.if_else(too_long, most / ca.if_else(too_long, length, 1), 1)


def unit_or_zero(vector: ca.SX) -> ca.SX:
    """Direction of a vector, and zero where it has none."""
    squared = ca.sumsqr(vector)
    exists = squared > _SHORTEST**2
    return vector * ca.if_else(exists, 1 / ca.sqrt(ca.if_else(exists, squared, 1)), 0)


# Vectors shorter than this have no direction [m, or 1].
_SHORTEST = 1e-9
# Entries of rows smaller than this, beside lever arms of the size of the arm, are rounding [m/rad, or 1].
_ROUNDING = 1e-12
