"""What a constraint adds to a bare formulation, in numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np

from kinqp.formulations import Formulation, Mode, lower
from kinqp.formulations.constraints import Constrained, Constraint

if TYPE_CHECKING:
    from collections.abc import Mapping

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
        function = self.lowered.function
        results = dict(zip(function.name_out(), function.call(self._arguments(q, v, inputs)), strict=True))
        columns = ("g", "b", "l", "u", "lb", "ub", "k", "x_feasible")
        return {name: np.asarray(x)[:, 0] if name in columns else np.asarray(x) for name, x in results.items()}

    def along(self, Q: Array, **inputs: ArrayLike) -> tuple[Array, Array]:
        """Give l, shape (N, k), and C, (N, k, n), of N states, all at once."""
        function = self.lowered.function
        arguments = self._arguments(Q[0], None, inputs)
        arguments[self.names.index("q")] = ca.DM(Q.T)
        results = dict(zip(function.name_out(), function.call(arguments), strict=True))
        C = np.asarray(results["C"])
        return np.asarray(results["l"]).T, C.reshape(C.shape[0], len(Q), -1).swapaxes(0, 1)

    @property
    def names(self) -> list[str]:
        """Names of the inputs."""
        return [given.name for given in self.lowered.inputs]

    def _arguments(self, q: ArrayLike, v: ArrayLike | None, inputs: Mapping[str, ArrayLike]) -> list[ca.DM]:
        values = {"q": q, "v": np.zeros(self.lowered.mode.m_free) if v is None else v}
        arguments = []
        for given in self.lowered.inputs:
            value = inputs.get(given.name, values.get(given.name, given.default))
            assert value is not None, given.name
            arguments.append(ca.DM(np.broadcast_to(np.asarray(value, dtype=float), (given.size,))))
        return arguments
