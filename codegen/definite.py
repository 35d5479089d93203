"""Whether the QP of a step has the curvature that the generated solver needs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..formulations import Lowered
    from .reduction import Reduced

    Array = NDArray[np.float64]

# The generated factorisation gives up on a pivot this small beside its diagonal entry.
_LEAST: Final = 1e-13
_STATES: Final = 3


class CurvatureError(ValueError):
    """A formulation's objective leaves directions without cost, which the generated solver can't take."""


def require_definite(lowered: Lowered, reduced: Reduced) -> None:
    """Refuse a QP whose reduced Hessian is singular on the null space of its equalities wherever one looks.

    Every tick of its C code would end in the safe stop. One that is singular in some states only passes.

    Raises
    ------
    CurvatureError
        Naming the formulation and what to do.
    """
    function = ca.Function("curvature", [given.symbol for given in lowered.inputs], [reduced.H, reduced.A])
    rng = np.random.default_rng(0)
    if not any(_definite(function, lowered, rng) for _ in range(_STATES)):
        raise CurvatureError(
            f"{lowered.formulation.name}: expected an objective that gives every variable weight, got one without cost"
            " along some direction, which the solver in C can't take; minimise that too, with a small weight"
        )


def _definite(function: ca.Function, lowered: Lowered, rng: np.random.Generator) -> bool:
    values = []
    for given in lowered.inputs:
        if given.name == "q":
            values.append(lowered.robot.random_configuration(rng))
        else:
            values.append(given.default if given.default is not None else np.abs(rng.normal(size=given.size)))
    H, A = (np.array(ca.DM(value), dtype=float) for value in function.call([ca.DM(value) for value in values]))
    left = H
    if A.size:
        _, sigma, rows = np.linalg.svd(A)
        null = rows[int(np.sum(sigma > 1e-9 * sigma[0])) :].T
        left = null.T @ H @ null
    if not left.size:
        return True
    scale = np.sqrt(np.diag(left))
    if not np.all(np.isfinite(left)) or np.min(scale) <= 0.0:
        return False
    return bool(np.min(np.linalg.eigvalsh(left / np.outer(scale, scale))) > _LEAST)
