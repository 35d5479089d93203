"""The one linear program that what a formulation yields is judged by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linprog

if TYPE_CHECKING:
    from kinqp.solvers import QP


def least(qp: QP, column: int) -> float:
    """Smallest value of a variable that the rows and the box of a QP admit, by SciPy's LP."""
    cost = np.zeros(qp.n)
    cost[column] = 1.0
    rows, sides = np.vstack((qp.C, -qp.C)), np.concatenate((qp.u, -qp.l))
    real = np.isfinite(sides)
    equal = {"A_eq": qp.A, "b_eq": qp.b} if qp.m_eq else {}
    box = list(zip(qp.lb, qp.ub, strict=True))
    answer = linprog(cost, rows[real], sides[real], **equal, bounds=box, method="highs")
    assert answer.status == 0
    return float(answer.fun)
