"""Linear costs: a declaration's, lowered, refused, and solved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np
import pytest

from kinqp.formulations import DeclarationError, Evaluator, Formulation, Mode, QuadraticProgram, Tick, lower
from kinqp.solvers import solve
from tests.robots.arms import arm

if TYPE_CHECKING:
    from collections.abc import Callable

ROBOT = arm("ur5e")


@dataclass(frozen=True)
class Costly(Formulation):
    """1/2 |qd|^2 and a given linear cost."""

    cost: Callable[[ca.SX, Tick], ca.SX] | None = None

    name: ClassVar[str] = "costly"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State it."""
        assert self.cost is not None
        qd = qp.variable("qd", tick.nv)
        qp.minimize(qd - 1.0)
        qp.minimize_linear(self.cost(qd, tick), name="price")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)


def test_it_adds_to_g_alone() -> None:
    made = Costly(cost=lambda qd, tick: 2 * qd[0] - ca.sin(tick.q[1]) * qd[3] + tick.q[0])
    qp = Evaluator(lower(made, ROBOT, Mode.position()))(q=[0.3, 0.5, 0, 0, 0, 0], v=np.zeros(3)).qp
    np.testing.assert_array_equal(qp.H, np.eye(6))
    np.testing.assert_allclose(qp.g, [1.0, -1.0, -1.0, -1.0 - np.sin(0.5), -1.0, -1.0], rtol=1e-15)
    np.testing.assert_allclose(solve(qp).x, np.clip(-qp.g, qp.lb, qp.ub), atol=1e-8)


def test_what_is_refused() -> None:
    qp = QuadraticProgram()
    x = qp.variable("x", 3)
    with pytest.raises(DeclarationError, match=r"^cost 1: expected a scalar as linear cost, got shape \(3, 1\)"):
        qp.minimize_linear(x)
    qp.minimize_linear(x[0])
    with pytest.raises(DeclarationError, match=r"^price: expected a scalar as linear cost, got shape \(1, 2\)"):
        qp.minimize_linear(x[:2].T, name="price")
    assert [cost.name for cost in qp.costs] == ["cost 1"]
    with pytest.raises(DeclarationError, match=r"^costly, price: expected an expression affine in the variables"):
        lower(Costly(cost=lambda qd, _: qd[0] ** 2), ROBOT, Mode.position())
