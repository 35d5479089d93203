"""What the arm could have done: the least Cartesian error that limits and locked rows leave at a state."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from ...formulations.bounds import velocity_bounds
from ...solvers import QP, Status, get_solver

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...solvers import Solver
    from .ticks import Ticks

    Array = NDArray[np.float64]

# Every so many ticks of a run are asked; what lasts shorter is not noticed.
STRIDE: Final = 10
# Joint motion costs so much of Cartesian error, to make it unique: less than 1e-4 of the hand's speed at 1 rad/s.
_JOINT_WEIGHT: Final = 1e-8


@dataclass(frozen=True)
class Possible:
    """The best command at some of a run's ticks, whoever was asked, and what was made of it.

    Best is the command of least Cartesian error |J_free qd - v| with the locked rows at rest and every joint within the
    velocity bounds (`viable`) that the scenario's limits leave at this state. It looks no further than the tick: what a
    better way to get here would have left is not in it.

    Attributes
    ----------
    tick : ndarray of int, shape (N,)
        Rows of the frame: every `STRIDE`-th, where the hand pulls.
    lost : ndarray, shape (N,)
        Share of v that the tool makes along it, short of the share that the best command makes of it: 0 where it makes
        as much or more (a command that breaks limits may, and so may a tool that lags behind a hand that slows down),
        1 at most [-].
    moved : ndarray, shape (N,)
        |J_free qd| of the best command [m/s, rad/s].
    qd : ndarray, shape (N, nv)
        The best commands [rad/s or m/s].
    """

    tick: NDArray[np.int64]
    lost: Array
    moved: Array
    qd: Array

    @classmethod
    def of(cls, ticks: Ticks) -> Possible:
        """Ask all ticks that are to be asked; those at which there is no answer are left out."""
        asked = np.flatnonzero(ticks.pulling)
        asked = asked[asked % STRIDE == 0]
        low, high = _bounds(ticks, asked)
        solver = get_solver("active-set")
        kept, lost, moved, best = [], [], [], []
        for row, lb, ub in zip(asked, low, high, strict=True):
            mode = ticks.mode(int(ticks.phase[row]))
            free, fixed = list(mode.free_rows), list(mode.fixed_rows)
            q, v, eps = ticks.q[row], ticks.v[row][free], ticks.eps[row][free]
            J = mode.twist_map_at(ticks.scenario.robot.pose(q)) @ ticks.scenario.robot.jacobian(q)
            qd = _least_error(J[free], J[fixed], v, lb, ub, solver)
            if qd is None:
                continue
            motion = J[free] @ qd
            kept.append(row)
            short = float((motion - v - eps) @ v) / float(v @ v)
            lost.append(min(max(short, 0.0), 1.0))
            moved.append(float(np.linalg.norm(motion)))
            best.append(qd)
        nv = ticks.scenario.robot.nv
        return cls(np.array(kept, dtype=np.int64), np.array(lost), np.array(moved), np.array(best).reshape(-1, nv))


def _least_error(J_free: Array, J_fixed: Array, v: Array, lb: Array, ub: Array, solver: Solver) -> Array | None:
    nv = J_free.shape[1]
    qp = QP.trusted(
        H=J_free.T @ J_free + _JOINT_WEIGHT * np.eye(nv), g=-J_free.T @ v, A=J_fixed, b=np.zeros(len(J_fixed)),
        lb=lb, ub=ub, x_feasible=np.zeros(nv),
    )  # fmt: skip
    solution = solver.solve(qp)
    found: Array = solution.x
    return found if solution.status is Status.SOLVED else None


def _bounds(ticks: Ticks, rows: NDArray[np.int64]) -> tuple[Array, Array]:
    """Joint velocity bounds that the scenario's limits leave at some ticks, shapes (N, nv)."""
    limits = [ticks.limit(name) for name in ("q_min", "q_max", "qd_max", "qdd_max")]
    nv = ticks.scenario.robot.nv
    if not len(rows):
        return np.zeros((0, nv)), np.zeros((0, nv))
    evaluate = _bounds_function(nv)
    low, high = evaluate(ticks.q[rows].T, *limits, ticks.scenario.dt)
    return np.array(low).T, np.array(high).T


@cache
def _bounds_function(nv: int) -> ca.Function:
    q, q_min, q_max, qd_max, qdd_max = (ca.SX.sym(name, nv) for name in ("q", "q_min", "q_max", "qd_max", "qdd_max"))
    dt = ca.SX.sym("dt")
    both = velocity_bounds("viable", q, q_min, q_max, qd_max, qdd_max, dt)
    return ca.Function("bounds", [q, q_min, q_max, qd_max, qdd_max, dt], list(both))
