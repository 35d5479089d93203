"""The same ticks as QPs: DAQP's time for them, and answers from solvers that are not ours."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import daqp
import numpy as np
import quadprog

from kinqp.control import make_step
from kinqp.solvers import solve

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinqp.formulations import Instance
    from kinqp.robots import Robot

    from .states import States

    Array = NDArray[np.float64]

# DAQP takes no infinities for bounds; this is its own.
_INFINITE: Final = 1e30
_EQUALITY: Final = 5
# Before every pass DAQP solves about as many of its problems untimed: what ran before has left the caches to itself.
WARM_UP: Final = 50
# Two answers closer than this, relative to the joint speed, are the same [-].
AGREE: Final = 1e-6
# An interior-point method, asked where the active-set references have no answer, is this close [-].
CLOSE: Final = 1e-5
_TIGHT: Final = {"primal_tol": 1e-11, "dual_tol": 1e-14, "zero_tol": 1e-13}


class Problems:
    """The QPs of many states, in the canonical form and as DAQP takes them.

    In DAQP's favour, bounded variables come first (it takes bounds of leading variables without a row for each), and
    every problem is copied to the same few arrays just before the call, as a controller has it: fresh in the cache.

    Parameters
    ----------
    robot : Robot
    formulation, mode : str
        Registered name, and as in `Mode.parse`.
    states : States
    """

    def __init__(self, robot: Robot, formulation: str, mode: str, states: States) -> None:
        step = make_step(robot, formulation, mode)
        self.instances: Final = [step.evaluate(q, v) for q, v in zip(states.q, states.v, strict=True)]
        *shapes, sense = _for_daqp(self.instances[0])
        self._packed: Final = np.array([_packed(instance) for instance in self.instances])
        self._buffer: Final = self._packed[0].copy()
        ends = np.cumsum([array.size for array in shapes])
        parts = np.split(self._buffer, ends[:-1])
        self._arguments: Final = (*(part.reshape(a.shape) for part, a in zip(parts, shapes, strict=True)), sense)
        count = len(self.instances)
        self.solve: Final[Array] = np.full(count, np.inf)
        self.both: Final[Array] = np.full(count, np.inf)
        self.failures = 0  #: most DAQP failures in one pass over a block

    def reset(self) -> None:
        """Forget the times so far."""
        self.solve.fill(np.inf)
        self.both.fill(np.inf)

    def passes(self, block: slice = slice(None)) -> None:
        """Solve every state of a block once with DAQP; keep the smallest times that it reports for each [ns]."""
        indices = range(len(self.instances))[block]
        for index in indices[:: max(1, len(indices) // WARM_UP)]:
            self.one(index)
        found = [self.one(index) for index in indices]
        self.keep(block, [(solve, setup) for solve, setup, _ in found])
        self.failures = max(self.failures, sum(flag != 1 for *_, flag in found))

    def one(self, index: int) -> tuple[float, float, int]:
        """Solve a single state with DAQP; its times for solution and set-up [s], and its flag (1: solved)."""
        self._buffer[:] = self._packed[index]
        _, _, flag, info = daqp.solve(*self._arguments)
        return info["solve_time"], info["setup_time"], flag

    def keep(self, block: slice, times: list[tuple[float, float]]) -> None:
        """Take reported times [s] into the minima of a block."""
        taken = np.array(times) * 1e9
        self.solve[block] = np.minimum(self.solve[block], taken[:, 0])
        self.both[block] = np.minimum(self.both[block], taken.sum(axis=1))

    def references(self) -> list[Array]:
        """Commands by DAQP at tight tolerances and by quadprog, each (N, nv); NaN where a solver gives none."""
        return [np.array([solver(i) for i in self.instances]) for solver in (_by_daqp, _by_quadprog)]


@dataclass(frozen=True)
class Verdict:
    """What is wrong with commands.

    Attributes
    ----------
    failed : int
        Ticks whose status is not solved.
    wrong : int
        Ticks whose command violates a bound or a locked row, or is not that of any reference.
    reference_failures : tuple of int
        Ticks at which DAQP, quadprog has no answer or not that of the command, while another reference agrees with it.
    """

    failed: int
    wrong: int
    reference_failures: tuple[int, ...]


def judge(problems: Problems, qd: Array, status: NDArray[np.intc]) -> Verdict:
    """Compare commands with the references, and with the bounds and locked rows they must hold.

    Parameters
    ----------
    problems : Problems
    qd : ndarray, shape (N, nv)
        Commands [rad/s].
    status : ndarray of int, shape (N,)
        0: solved.
    """
    solved = status == 0
    allowed = AGREE * (1.0 + np.max(np.abs(qd), axis=1))
    off = np.array([np.max(np.abs(reference - qd), axis=1) for reference in problems.references()])
    agrees = off <= allowed  # False for NaN
    right = agrees.any(axis=0)
    for index in np.flatnonzero(~right & solved):
        # Neither has an answer, or neither the same: an interior point decides.
        instance = problems.instances[index]
        answer = instance.K @ solve(instance.qp, "clarabel").x + instance.k
        off_it = float(np.max(np.abs(answer - qd[index])))
        right[index] = off_it <= CLOSE * (1.0 + np.max(np.abs(qd[index])))
    broken = np.array([_breaks(i, command) for i, command in zip(problems.instances, qd, strict=True)])
    wrong = solved & (broken | ~right)
    alone = right & ~agrees
    return Verdict(int(np.sum(~solved)), int(np.sum(wrong)), tuple(int(n) for n in alone.sum(axis=1)))


def _breaks(instance: Instance, qd: Array) -> bool:
    excess = max(float(np.max(qd - instance.qd_hi)), float(np.max(instance.qd_lo - qd)))
    share = np.maximum(np.abs(instance.J_fixed) @ np.abs(qd), 1.0)
    locked = np.abs(instance.J_fixed @ qd - instance.v_fixed)
    return bool(excess > 1e-8 or np.any(locked > 1e-9 * share))


def _for_daqp(instance: Instance) -> tuple[Any, ...]:
    qp = instance.qp
    bounded = np.isfinite(qp.lb) | np.isfinite(qp.ub)
    order = np.argsort(~bounded, kind="stable")
    rows = np.ascontiguousarray(np.vstack((qp.C, qp.A))[:, order])
    leading = order[: bounded.sum()]
    upper = np.clip(np.concatenate((qp.ub[leading], qp.u, qp.b)), -_INFINITE, _INFINITE)
    lower = np.clip(np.concatenate((qp.lb[leading], qp.l, qp.b)), -_INFINITE, _INFINITE)
    sense = np.zeros(len(upper), dtype=np.intc)
    sense[len(upper) - len(qp.b) :] = _EQUALITY
    return np.ascontiguousarray(qp.H[np.ix_(order, order)]), qp.g[order], rows, upper, lower, sense


def _packed(instance: Instance) -> Array:
    return np.concatenate([array.ravel() for array in _for_daqp(instance)[:-1]])


def _by_daqp(instance: Instance) -> Array:
    qp = instance.qp
    order = np.argsort(~(np.isfinite(qp.lb) | np.isfinite(qp.ub)), kind="stable")
    x, _, flag, _ = daqp.solve(*_for_daqp(instance), **_TIGHT)
    if flag != 1:
        return np.full(len(instance.k), np.nan)
    answer = np.empty(len(order))
    answer[order] = x
    return np.asarray(instance.K @ answer + instance.k)


def _by_quadprog(instance: Instance) -> Array:
    qp = instance.qp
    rows = np.vstack((qp.stacked, -qp.stacked[len(qp.b) :]))
    bounds = np.concatenate((qp.lower, -qp.upper[len(qp.b) :]))
    finite = np.isfinite(bounds)
    with contextlib.suppress(ValueError):
        x = quadprog.solve_qp(
            qp.H.copy(), -qp.g, np.ascontiguousarray(rows[finite].T), bounds[finite].copy(), len(qp.b)
        )[0]
        return np.asarray(instance.K @ np.asarray(x) + instance.k)
    return np.full(len(instance.k), np.nan)
