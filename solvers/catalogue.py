"""QPs whose solutions are known by hand, for the tests of every solver.

The author of a new backend runs it over `CATALOGUE` and compares with the answers;
``tests/solvers/test_catalogue.py`` does this for all registered ones. Every answer is derived in the comment
above its entry.
"""

from __future__ import annotations

import numpy as np

from .known import KnownQP, known_solution
from .qp import QP
from .solution import Status

__all__ = ["CATALOGUE", "KnownQP"]

_INF = np.inf
_I2 = np.eye(2)
_BEALE = 2.0**-10

CATALOGUE: tuple[KnownQP, ...] = (
    # H x = -g: 2 x0 = 2, 4 x1 = 4.
    known_solution("unconstrained", "No constraints at all.", QP(H=np.diag([2.0, 4.0]), g=[-2, -4]), [1, 1]),
    # Projection of (1, 1) on x0 + x1 <= 1 is (1/2, 1/2); x + g + z (1, 1) = 0 gives z = 1/2.
    known_solution(
        "one-active-row",
        "One row of three is active.",
        QP(H=_I2, g=[-1, -1], C=[[1, 1], [1, -1], [1, 0]], l=[-_INF, -3, -4], u=[1, 3, 4], x_feasible=[0, 0]),
        [0.5, 0.5],
        z=[0.5, 0, 0],
    ),
    # Mirror image of the above: the lower side is active, so the multiplier is negative.
    known_solution(
        "one-active-row-lower",
        "The lower side of a two-sided row is active.",
        QP(H=_I2, g=[1, 1], C=[[1, 1]], l=[-1], u=[2], x_feasible=[0, 0]),
        [-0.5, -0.5],
        z=[-0.5],
    ),
    # Both rows active at (1, 2); z = -(x + g) = -(1 - 3, 2 - 5).
    known_solution(
        "vertex",
        "As many independent active rows as variables.",
        QP(H=_I2, g=[-3, -5], C=_I2, l=[-1, -2], u=[1, 2], x_feasible=[0, 0]),
        [1, 2],
        z=[2, 3],
    ),
    # x = (1, 1) as x0 <= 1 and x1 <= 1 hold with multipliers (1, 1); x0 + x1 <= 2 passes through the same
    # point, so (1 - t, 1 - t, t) for t in [0, 1] are multipliers too.
    known_solution(
        "degenerate-vertex",
        "Three rows through one point in the plane: the multipliers are not unique.",
        QP(H=_I2, g=[-2, -2], C=[[1, 0], [0, 1], [1, 1]], u=[1, 1, 2], x_feasible=[0, 0]),
        [1, 1],
        z=[1, 1, 0],
        dual_unique=False,
    ),
    # The unconstrained minimiser (1, 0) lies on x0 <= 1: active with multiplier zero. Slack and multiplier
    # are then the same size, so a gap of 1e-9 leaves both at the root of it.
    known_solution(
        "weakly-active",
        "An active row with multiplier zero (no strict complementarity).",
        QP(H=_I2, g=[-1, 0], C=_I2, l=[-3, -3], u=[1, 3], x_feasible=[0, 0]),
        [1, 0],
        z=[0, 0],
        accuracy=1e-4,
    ),
    # As one-active-row with the row given three times; z1 + 2 z2 + z3 = 1/2.
    known_solution(
        "dependent-rows",
        "The active row is there three times, once doubled.",
        QP(H=_I2, g=[-1, -1], C=[[1, 1], [2, 2], [1, 1]], u=[1, 2, 1], x_feasible=[0, 0]),
        [0.5, 0.5],
        z=[0.5, 0, 0],
        dual_unique=False,
    ),
    # On x0 + x1 <= 1 the projection of (1, 2) is (0, 1); x + g + z (1, 1) = 0 gives z1 + 2 z2 = 1.
    known_solution(
        "dependent-rows-at-start",
        "Dependent rows that are all active at the start.",
        QP(H=_I2, g=[-1, -2], C=[[1, 1], [2, 2]], u=[1, 2], x_feasible=[1, 0]),
        [0, 1],
        z=[1, 0],
        dual_unique=False,
    ),
    # Projection of 0 on x0 + x1 = 2: x = (1, 1), y1 + 2 y2 = -1.
    known_solution(
        "dependent-equalities",
        "A consistent equality given twice.",
        QP(H=_I2, g=[0, 0], A=[[1, 1], [2, 2]], b=[2, 4], x_feasible=[2, 0]),
        [1, 1],
        y=[-1, 0],
        dual_unique=False,
    ),
    # x2 = 1 from the equality with x0 + x1 + x2 = 3 and symmetry; x + y (1, 1, 1) = 0.
    known_solution(
        "equality-only",
        "One equality and nothing else.",
        QP(H=np.eye(3), g=np.zeros(3), A=[[1, 1, 1]], b=[3], x_feasible=[3, 0, 0]),
        [1, 1, 1],
        y=[-1],
    ),
    # x0 + x1 = 1 with x0 <= 1/4: x = (1/4, 3/4); second row: 3/4 + y = 0; first: 1/4 - 3/4 + z_box = 0.
    known_solution(
        "equality-and-box",
        "An equality and one active side of the box.",
        QP(H=_I2, g=[0, 0], A=[[1, 1]], b=[1], lb=[-1, -1], ub=[0.25, 2], x_feasible=[0, 1]),
        [0.25, 0.75],
        y=[-0.75],
        z_box=[0.5, 0],
    ),
    # Separable: clip(-g) = (1, -1, 1/2); z_box = -(x + g).
    known_solution(
        "box-only",
        "Upper, lower and no side of the box active.",
        QP(H=np.eye(3), g=[-3, 2, -0.5], lb=[-1, -1, -1], ub=[1, 1, 1], x_feasible=[0, 0, 0]),
        [1, -1, 0.5],
        z_box=[2, -1, 0],
    ),
    # One-sided box: x0 <= 1 only, x1 >= -1 only, x2 free.
    known_solution(
        "half-open-box",
        "Every variable has another set of sides.",
        QP(H=np.eye(3), g=[-3, 2, -7], lb=[-_INF, -1, -_INF], ub=[1, _INF, _INF], x_feasible=[0, 0, 0]),
        [1, -1, 7],
        z_box=[2, -1, 0],
    ),
    # l = u makes the row an equality: x0 - x1 = 1, and the projection of (0, 0) is (1/2, -1/2); 1/2 + z = 0.
    known_solution(
        "equal-sides",
        "A two-sided row whose sides coincide, and a box that pins one variable.",
        QP(
            H=np.eye(3),
            g=[0, 0, -9],
            C=[[1, -1, 0]],
            l=[1],
            u=[1],
            lb=[-2, -2, 2],
            ub=[2, 2, 2],
            x_feasible=[1, 0, 2],
        ),
        [0.5, -0.5, 2],
        z=[-0.5],
        z_box=[0, 0, 7],
    ),
    # x1 does not enter the cost, but 1/2 x0^2 - x0 wants x0 = 1 and the linear cost pushes x1 to its upper
    # side.
    known_solution(
        "semidefinite-unique",
        "H is singular; the box makes the minimiser unique.",
        QP(H=np.diag([1.0, 0.0]), g=[-1, -1], lb=[-2, -2], ub=[2, 2], x_feasible=[0, 0]),
        [1, 2],
        z_box=[0, 1],
    ),
    # Cost 1/2 (x0 + x1)^2 - (x0 + x1): every point with x0 + x1 = 1 in the box is optimal.
    known_solution(
        "flat-valley",
        "H is singular and a whole segment is optimal.",
        QP(H=[[1, 1], [1, 1]], g=[-1, -1], lb=[-1, -1], ub=[1, 1], x_feasible=[0, 0]),
        [0.5, 0.5],
        x_unique=False,
    ),
    # A linear programme: the minimum of -x0 - 2 x1 over x0 + x1 <= 1, x >= 0 is the corner (0, 1) with z = 2:
    # -1 + 2 + z_box0 = 0.
    known_solution(
        "linear-programme",
        "H is zero.",
        QP(H=np.zeros((2, 2)), g=[-1, -2], C=[[1, 1]], u=[1], lb=[0, 0], x_feasible=[0.25, 0.25]),
        [0, 1],
        z=[2],
        z_box=[-1, 0],
    ),
    # H = diag(1e4, 1e-4), minimiser (1, 1); the row 1e3 x0 <= 500 is active at x0 = 1/2: 5000 - 10000 + 1e3 z
    # = 0.
    known_solution(
        "badly-scaled",
        "Curvatures from 1e-4 to 1e4 and a row multiplied by 1e3.",
        QP(H=np.diag([1e4, 1e-4]), g=[-1e4, -1e-4], C=[[1e3, 0]], l=[-500], u=[500], x_feasible=[0, 0]),
        [0.5, 1],
        z=[5],
    ),
    # x0 <= 1/2, written with entries of 1e-7: 1/2 - 1 + 1e-7 z = 0.
    known_solution(
        "tiny-row",
        "The active row is multiplied by 1e-7.",
        QP(H=_I2, g=[-1, 0], C=[[1e-7, 0]], l=[-0.5e-7], u=[0.5e-7], x_feasible=[0, 0]),
        [0.5, 0],
        z=[5e6],
    ),
    # Unconstrained minimiser 4e-6 away from the start, inside the box.
    known_solution(
        "tiny-step",
        "The minimiser is 4e-6 away from the start.",
        QP(H=_I2, g=[-4e-6, 0], lb=[-1, -1], ub=[1, 1], x_feasible=[0, 0]),
        [4e-6, 0],
    ),
    # Rows 0 (lower), 1 (upper) and 3 (lower) meet at x; x + g = (5/2, -2, 7/4) = -C'z has that z and no other.
    known_solution(
        "hidden-dependence",
        "Four rows through the start, the active ones easily mistaken for another three.",
        QP(
            H=np.eye(3),
            g=[3, -2, 2],
            C=[[-1, 2, 2], [-1, 1, 2], [0, 0, 1], [1, -1, 2], [-2, 0, 2]],
            l=[0, -1, -2, -1, -2],
            u=[2, 0, 0, 0, 2],
            x_feasible=[0, 0, 0],
        ),
        [-0.5, 0, -0.25],
        z=[-0.5, 1.3125, 0, -1.6875, 0],
    ),
    # Beale's linear programme (Naval Research Logistics Quarterly 2, 1955), on which the simplex method cycles, with
    # H = e I, e = 2^-10. At x = (1, 0, 1, 0) the rows -x1, -x3, x2 <= 1 and (1/2, -12, -1/2, 3) are active, and
    # e x + g + C'z = 0 reads, component by component: e - 3/4 + z4 / 2 = 0, 20 - 12 z4 - z5 = 0,
    # e - 1/2 - z4 / 2 + z6 = 0, 6 + 3 z4 - z3 = 0.
    known_solution(
        "beale",
        "A degenerate vertex at which exchanging one active row at a time runs in circles.",
        QP(
            H=_BEALE * np.eye(4),
            g=[-0.75, 20, -0.5, 6],
            C=np.array(
                [
                    [-1, 0, 0, 0],
                    [0, 0, -1, 0],
                    [0.25, -8, -1, 9],
                    [0, 0, 0, -1],
                    [0.5, -12, -0.5, 3],
                    [0, -1, 0, 0],
                    [0, 0, 1, 0],
                ]
            ),
            u=[0, 0, 0, 0, 0, 0, 1],
            x_feasible=[0, 0.5, 0, 0],
        ),
        [1, 0, 1, 0],
        z=[0, 0, 0, 10.5 - 6 * _BEALE, 1.5 - 2 * _BEALE, 2 + 24 * _BEALE, 1.25 - 2 * _BEALE],
        accuracy=1e-6,
    ),
    # x0 >= 1 and x0 <= -1 cannot both hold; z = (-1, 1) proves it: 0'x = 0 <= -1 - 1.
    KnownQP(
        "infeasible-rows",
        "Two rows contradict each other.",
        QP(H=_I2, g=[0, 0], C=[[1, 0], [1, 0]], l=[1, -_INF], u=[_INF, -1]),
        Status.PRIMAL_INFEASIBLE,
    ),
    # x0 + x1 = 5 is out of reach of the box |x| <= 1.
    KnownQP(
        "infeasible-equality",
        "The equality is out of reach of the box.",
        QP(H=_I2, g=[1, 1], A=[[1, 1]], b=[5], lb=[-1, -1], ub=[1, 1]),
        Status.PRIMAL_INFEASIBLE,
    ),
    # Along (0, 1) the cost is -t and nothing stops it.
    KnownQP(
        "unbounded",
        "The cost falls without end in a flat direction of H.",
        QP(H=np.diag([1.0, 0.0]), g=[0, -1], lb=[-1, -1], x_feasible=[0, 0]),
        Status.DUAL_INFEASIBLE,
    ),
)
