"""What a constraint adds to a bare formulation, in numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np

from kinqp.formulations import Formulation, Mode, lower
from kinqp.formulations.constraints import Constrained, Constraint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from kinqp.formulations import QuadraticProgram, Tick
    from kinqp.robots import Robot

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bare(Formulation):
    """Joint velocities and nothing else: the rows of a constraint are then rows on qd."""

    name: ClassVar[str] = "bare"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        qd = qp.variable("qd", tick.nv)
        qp.minimize(qd)
        qp.command(qd)
        qp.feasible(qd=0.0)


class RowsOf:
    """The rows of a constraint at a state: C, l, u, A, b in the variables (qd, and what it yields by)."""

    def __init__(self, constraint: Constraint, robot: Robot, mode: str = "free") -> None:
        self.lowered = lower(Constrained(formulation=Bare(), constraints=(constraint,)), robot, Mode.parse(mode))

    def __call__(self, q: ArrayLike, v: ArrayLike | None = None, **inputs: ArrayLike) -> dict[str, Array]:
        values = {"q": q, "v": np.zeros(self.lowered.mode.m_free) if v is None else v}
        arguments = []
        for given in self.lowered.inputs:
            value = inputs.get(given.name, values.get(given.name, given.default))
            assert value is not None, given.name
            arguments.append(np.broadcast_to(np.asarray(value, dtype=float), (given.size,)))
        results = dict(
            zip(
                self.lowered.function.name_out(), self.lowered.function.call([ca.DM(a) for a in arguments]), strict=True
            )
        )
        return {
            name: np.asarray(value)[:, 0]
            if name in ("g", "b", "l", "u", "lb", "ub", "k", "x_feasible")
            else np.asarray(value)
            for name, value in results.items()
        }
