"""Declarations that are refused: at once, at lowering, and wherever an expression is not affine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import pytest

from kinqp.formulations import DeclarationError, QuadraticProgram, Tick
from tests.formulations.declared import lowered, with_qd

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.formulations.declared import Declare


def _twice(act: Callable[[], object]) -> None:
    act()
    act()


REFUSED_AT_ONCE: list[tuple[str, Callable[[QuadraticProgram, ca.SX], object]]] = [
    ("variable x: expected a new name, it is declared already", lambda qp, _: qp.variable("x", 2)),
    ("variable y: expected a size of at least 1, got 0", lambda qp, _: qp.variable("y", 0)),
    (r"term 1: expected a column as residual, got shape \(1, 3\)", lambda qp, x: qp.minimize(x.T)),
    (r"speed: expected a column as residual, got shape \(1, 3\)", lambda qp, x: qp.minimize(x.T, name="speed")),
    (r"speed: expected one weight or 3, got shape \(2, 1\)", lambda qp, x: qp.minimize(x, np.ones(2), name="speed")),
    (
        "speed: expected weights that are not negative",
        lambda qp, x: qp.minimize(x, np.array([1.0, -1e-9, 1.0]), name="speed"),
    ),
    ("speed: expected weights that are not negative", lambda qp, x: qp.minimize(x, np.nan, name="speed")),
    ("rows: expected a new name", lambda qp, x: _twice(lambda: qp.between(0, x, 1, name="rows"))),
    (r"rows: expected sides of shape \(3, 1\), got \(2, 1\)", lambda qp, x: qp.equal(x, np.ones(2), name="rows")),
    (r"rows: expected sides of shape \(3, 1\), got \(2, 1\)", lambda qp, x: qp.between(np.ones(2), x, 1, name="rows")),
    (r"rows: expected sides of shape \(3, 1\), got \(4, 1\)", lambda qp, x: qp.between(0, x, np.ones(4), name="rows")),
    (r"rows: expected a column, got shape \(1, 3\)", lambda qp, x: qp.equal(x.T, 0.0, name="rows")),
    ("command: expected one command", lambda qp, x: _twice(lambda: qp.command(x))),
    ("feasible point: expected variables among x, got y", lambda qp, _: qp.feasible(y=0.0)),
    (r"feasible point: expected x of shape \(3, 1\), got \(2, 1\)", lambda qp, _: qp.feasible(x=np.zeros(2))),
    (r"feasible point: expected x of shape \(3, 1\), got \(3, 2\)", lambda qp, _: qp.feasible(x=np.zeros((3, 2)))),
    (r"feasible point: expected x of shape \(3, 1\), got \(1, 3\)", lambda qp, x: qp.feasible(x=x.T)),
]


@pytest.mark.parametrize(("message", "act"), REFUSED_AT_ONCE)
def test_declaration_refuses(message: str, act: Callable[[QuadraticProgram, ca.SX], object]) -> None:
    qp = QuadraticProgram()
    x = qp.variable("x", 3)
    with pytest.raises(DeclarationError, match=f"^{message}"):
        act(qp, x)


def _nothing(qp: QuadraticProgram, tick: Tick) -> None:
    """Declare nothing."""


def _half_a_point(qp: QuadraticProgram, _tick: Tick, _qd: ca.SX) -> None:
    qp.variable("slack", 1)
    qp.feasible(qd=0.0)


REFUSED_AT_LOWERING: list[tuple[str, Declare]] = [
    ("declared: expected at least one variable, got none", _nothing),
    ("declared: expected at least one command, got none", lambda qp, _: qp.variable("x", 6)),
    (
        "declared, speed: expected a weight free of the variables",
        with_qd(lambda qp, _, x: qp.minimize(x, x[0], name="speed")),
    ),
    (
        "declared, wall: expected sides free of the variables",
        with_qd(lambda qp, _, x: qp.between(x[1:3], x[0:2], 1.0, name="wall")),
    ),
    (
        "declared, wall: expected sides free of the variables",
        with_qd(lambda qp, _, x: qp.between(0.0, x[0:2], x[1:3], name="wall")),
    ),
    (
        "declared, command: expected 6 rows, one for each joint, got 5",
        lambda qp, _: qp.command(qp.variable("x", 5)),
    ),
    (
        "declared, feasible point: expected a value for slack, got none",
        with_qd(_half_a_point),
    ),
]


@pytest.mark.parametrize(("message", "declaration"), REFUSED_AT_LOWERING)
def test_lowering_refuses(message: str, declaration: Declare) -> None:
    with pytest.raises(DeclarationError, match=f"^{message}"):
        lowered(declaration)


NONLINEAR: list[Callable[[ca.SX, ca.SX], ca.SX]] = [
    lambda x, _: x[0] * x[1],
    lambda x, _: x[0] ** 2,
    lambda x, q: ca.sin(x[0]) + q[0],
    lambda x, _: ca.fabs(x[2]),
    lambda x, _: ca.fmax(x[0], x[1]),
    lambda x, _: x[0] / (2 + x[1]),
    lambda x, _: ca.if_else(x[0] > 0, x[1], 2 * x[1]),
    # Their derivatives do not depend on x, and yet they are not affine.
    lambda x, _: ca.floor(x[0]) + x[1],
    lambda x, q: ca.sign(x[0]) * q[0],
    lambda x, q: ca.if_else(x[0] > q[0], 1, 2),
    lambda x, _: ca.fmod(x[0], 2),
]


@pytest.mark.parametrize("expression", NONLINEAR)
def test_a_nonlinear_expression_is_refused_wherever_it_stands(expression: Callable[[ca.SX, ca.SX], ca.SX]) -> None:
    def command(qp: QuadraticProgram, tick: Tick) -> None:
        x = qp.variable("x", 6)
        qp.command(ca.vertcat(x[:5], expression(x, tick.q)))

    places: dict[str, Declare] = {
        "slowness": with_qd(lambda qp, t, x: qp.minimize(expression(x, t.q), name="slowness")),
        "wall": with_qd(lambda qp, t, x: qp.equal(0.0, expression(x, t.q), name="wall")),
        "floor": with_qd(lambda qp, t, x: qp.between(-1.0, expression(x, t.q), 1.0, name="floor")),
        "command": command,
    }
    for name, declaration in places.items():
        with pytest.raises(
            DeclarationError, match=f"^declared, {name}: expected an expression affine in the variables"
        ):
            lowered(declaration)
