"""Problems written in cvxpy that are refused as formulations, each in one sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cvxpy as cp
import numpy as np
import pytest
from cvxpy.atoms.affine.binary_operators import multiply
from cvxpy.atoms.norm import norm2
from cvxpy.atoms.sum_squares import sum_squares

from kinqp.formulations import DeclarationError, Formulation, Mode, lower
from tests.formulations.in_cvxpy import NV, parameter
from tests.robots.arms import arm

if TYPE_CHECKING:
    from collections.abc import Callable

ROBOT = arm("lbr_med14")
MODE = Mode.fix_orientation()
X = cp.Variable(NV, name="x")
Q, V, W = parameter("q", NV), parameter("v", NV), parameter("w")
FREE = cp.Minimize(sum_squares(X))


def with_rows(*rows: Any) -> cp.Problem:
    return cp.Problem(FREE, list(rows))


REFUSED: list[tuple[str, Callable[[], tuple[Any, Any]]]] = [
    (r"refused, problem: expected a cvxpy\.Problem, got 7", lambda: (7, X)),
    ("refused, command: expected a cvxpy expression of the joint velocities, got None", lambda: (with_rows(), None)),
    ("refused, command: expected an affine expression, got", lambda: (with_rows(), cp.square(X))),
    (
        "refused, command: expected variables of the problem, got other",
        lambda: (with_rows(), cp.Variable(NV, name="other")),
    ),
    (
        "refused, command: expected an expression that follows the rules of DPP",
        lambda: (with_rows(), W * multiply(Q, X)),
    ),
    (
        "refused, objective: expected a DPP problem, which never multiplies two Parameters",
        lambda: (cp.Problem(cp.Minimize(sum_squares(W * multiply(Q, X)))), X),
    ),
    ("refused, wall: expected a DPP problem", lambda: (with_rows((W * (W * X) <= 1).set_label("wall")), X)),
    ("refused, constraint 2: expected a DPP problem", lambda: (with_rows(X <= 1, W * (W * X) <= 1), X)),
    (
        "refused, objective: expected a convex problem by the rules of DCP",
        lambda: (cp.Problem(cp.Minimize(cp.sqrt(X[0]))), X),
    ),
    ("refused, objective: expected a QP", lambda: (cp.Problem(cp.Minimize(norm2(X))), X)),
    ("refused, ball: expected a QP", lambda: (with_rows((sum_squares(X) <= 1).set_label("ball")), X)),
    (
        "refused, problem: expected continuous variables, got integer",
        lambda: (with_rows(cp.Variable(boolean=True) <= X), X),
    ),
    (
        "refused, problem: expected real variables and parameters",
        lambda: (with_rows(cp.Variable(complex=True) == 0), X),
    ),
    ("refused, parameter param[0-9]+: expected an identifier as name", lambda: (with_rows(cp.Parameter() <= X), X)),
    ("refused, parameter my speed: expected an identifier", lambda: (with_rows(parameter("my speed") <= X), X)),
    (
        "refused, parameter w: expected one Parameter of this name, got two",
        lambda: (with_rows(parameter("w") + W <= X), X),
    ),
    (
        r"refused, parameter v: expected shape \(3,\) for lbr_med14 in mode fix-orientation, got \(7,\)",
        lambda: (with_rows(V <= X), X),
    ),
    (
        r"refused, parameter J_free: expected shape \(3, 7\).*got \(7,\)",
        lambda: (with_rows(parameter("J_free", NV) <= X), X),
    ),
    ("refused, parameter inputs: expected another name", lambda: (with_rows(parameter("inputs", NV) <= X), X)),
    ("refused, parameter z: expected no sign or nonneg=True", lambda: (with_rows(parameter("z", nonpos=True) <= X), X)),
    ("refused, command: expected 7 rows, one for each joint, got 3", lambda: (with_rows(), X[:3])),
]


@pytest.mark.parametrize(("message", "make"), REFUSED)
def test_what_is_refused_in_one_sentence(message: str, make: Callable[[], tuple[Any, Any]]) -> None:
    written, command = make()
    with pytest.raises(DeclarationError, match=f"^{message}") as caught:
        lower(Formulation.from_cvxpy(written, command=command, name="refused"), ROBOT, MODE)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("feasible", "message"),
    [
        ({"y": 0.0}, "refused, feasible point, y: expected a variable among x"),
        ({"x": np.zeros(3)}, r"refused, feasible point, x: expected Parameters and numbers of shape \(7,\)"),
        ({"x": X}, r"refused, feasible point, x: expected Parameters and numbers of shape \(7,\)"),
        ({"x": multiply(Q, Q)}, "refused, feasible point, x: expected an expression that follows the rules of DPP"),
    ],
)
def test_feasible_points_are_refused_too(feasible: dict[str, Any], message: str) -> None:
    with pytest.raises(DeclarationError, match=f"^{message}"):
        Formulation.from_cvxpy(with_rows(), command=X, name="refused", feasible=feasible)


def test_names_are_kebab_case() -> None:
    with pytest.raises(DeclarationError, match=r"^name: expected kebab-case as in 'joint-space', got 'Joint Space'"):
        Formulation.from_cvxpy(with_rows(), command=X, name="Joint Space")
    with pytest.raises(ValueError, match=r"^bounds: expected one of thesis, viable"):
        Formulation.from_cvxpy(with_rows(), command=X, name="x", bounds="square")
