"""How many steps the active set can take for one J#: every path that bounds and the hand can send it along.

For a fixed M = J# the QP of `cartesian-error` has data that are linear in theta = (v, qd_lo, qd_hi): minimise
1/2 |eps|^2 subject to qd_lo <= M (v + eps) <= qd_hi. Along a fixed sequence of decisions (which row enters, which one
is dropped) iterate and multipliers of the dual method of Goldfarb and Idnani are linear in theta too, and so is every
comparison that decides: the thetas of a path are a polyhedral cone. A linear program says whether it has an inside.
The method is that of Arnstrom and Axehill (IEEE TAC 67(6), 2022) for parametric QPs, for our own rule of entering.
Paths multiply fast: seconds for one direction or a few rows; three directions of a seven-axis arm are out of reach.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import linprog

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    Side = tuple[int, int]

# A cone that holds no ball of this radius, within the unit box, counts as empty; well above what linear programs are
# solved to, so that their rounding is not taken for a cone.
THINNEST: Final = 1e-7
_TOLERANCE: Final = 1e-10
# Samples that spare linear programs: a cone that holds one of them needs none.
_CLOUD: Final = 20_000
_CAP: Final = 60
_OPTIONS: Final = {"primal_feasibility_tolerance": _TOLERANCE, "dual_feasibility_tolerance": _TOLERANCE}
# Rows of M as dependent as this have paths that rounding decides.
_DEPENDENT: Final = 1e-6


@dataclass(frozen=True)
class IterationBound:
    """The most steps of any path, and where it is taken.

    Attributes
    ----------
    iterations : int
        No theta inside a path's cone takes more. Left out are cones thinner than `THINNEST` and ties exactly on the
        border between cones; decisions are as in exact arithmetic.
    v : ndarray, shape (m_free,)
        With `qd_lo` and `qd_hi`, a theta that takes as many [m/s, rad/s].
    qd_lo, qd_hi : ndarray, shape (nv,)
        [rad/s or m/s].
    margin : float
        Radius of the ball about it, in theta, that is within the same cone.
    cones : tuple of int
        Cones found after 1, 2, ... steps, up to the sign of theta.
    programs : int
        Linear programs solved.
    """

    iterations: int
    v: Array
    qd_lo: Array
    qd_hi: Array
    margin: float
    cones: tuple[int, ...]
    programs: int


@dataclass(frozen=True)
class _Node:
    """A path so far; `w`, `u`, `entering` are linear in theta, `held` are its comparisons, each >= 0."""

    steps: int
    active: tuple[Side, ...]
    w: Array
    u: Array
    held: Array
    cloud: Array
    row: Side | None = None
    entering: Array | None = None


def iteration_bound(M: ArrayLike, on_progress: Callable[[int, int], None] | None = None) -> IterationBound:
    """Bound the active set's steps for one J#, over all hands v and all bounds with qd_lo <= 0 <= qd_hi.

    Parameters
    ----------
    M : array_like, shape (nv, m_free)
        J#.
    on_progress : callable, optional
        Told the cones and linear programs so far.

    Raises
    ------
    ValueError
        When M isn't a finite matrix whose every m_free rows are independent: rounding would decide its paths.
    """
    matrix = np.array(M, dtype=float)
    _check(matrix)
    return _Enumeration(matrix, on_progress).run()


def _check(M: Array) -> None:
    if M.ndim != 2 or not M.size or not np.isfinite(M).all():
        raise ValueError(f"M: expected a finite matrix of shape (nv, m_free), got {M}")
    norms = np.linalg.norm(M, axis=1)
    if not norms.all():
        raise ValueError(f"M: expected rows that are not zero, got zero in row {int(np.argmin(norms))}")
    unit, n = M / norms[:, None], M.shape[1]
    for rows in combinations(range(len(M)), min(n, len(M))):
        least = np.linalg.svd(unit[list(rows)], compute_uv=False)[-1]
        if least < _DEPENDENT:
            raise ValueError(f"M: expected any {n} rows to be independent, got {least:.1e} as {rows}' singular value")


class _Enumeration:
    def __init__(self, M: Array, on_progress: Callable[[int, int], None] | None) -> None:
        self._M = M
        self._nv, self._n = M.shape
        self._size = self._n + 2 * self._nv
        self._norm = np.linalg.norm(M, axis=1)
        self._sides = [(i, sign) for i in range(self._nv) for sign in (-1, 1)]
        self._programs = 0
        self._cones: Counter[int] = Counter()
        self._on_progress = on_progress

    def run(self) -> IterationBound:
        nothing = np.zeros((0, self._size))
        zero = np.zeros((self._n, self._size))
        signs = np.zeros((2 * self._nv, self._size))
        signs[np.arange(2 * self._nv), self._n + np.arange(2 * self._nv)] = np.repeat([-1.0, 1.0], self._nv)
        cloud = np.random.default_rng(0).uniform(-1.0, 1.0, (_CLOUD, self._size))
        cloud[:, self._n :] = np.abs(cloud[:, self._n :]) * np.repeat([-1.0, 1.0], self._nv)
        cloud[:, self._n :] *= 10.0 ** -np.random.default_rng(1).uniform(0.0, 3.0, (_CLOUD, 2 * self._nv))
        stack = [_Node(0, (), zero, nothing, signs, cloud)]
        best = stack[0]
        while stack:
            node = stack.pop()
            if node.steps > best.steps:
                best = node
            if node.steps >= _CAP:
                raise RuntimeError(f"iteration bound: a path longer than {_CAP} steps, {node.active}")
            stack.extend(self._after(node))
            if self._on_progress is not None:
                self._on_progress(self._cones.total(), self._programs)
        theta, margin = self._inside(best.held)
        v, qd_lo, qd_hi = np.split(theta, [self._n, self._n + self._nv])
        cones = tuple(self._cones[steps] for steps in range(1, best.steps + 1))
        return IterationBound(best.steps, v, qd_lo, qd_hi, margin, cones, self._programs)

    def _normal(self, side: Side) -> Array:
        """P of the side's constraint p'w >= bound."""
        normal: Array = -side[1] * self._M[side[0]]
        return normal

    def _gap(self, side: Side, w: Array) -> Array:
        """How far w is outside a side [unit of M w], linear in theta."""
        row, sign = side
        gap = -self._normal(side) @ w
        gap[: self._n] -= self._normal(side)
        gap[self._n + row + (self._nv if sign > 0 else 0)] -= sign
        return gap

    def _after(self, node: _Node) -> Iterator[_Node]:
        if node.row is not None:
            yield from self._steps(node)
            return
        within = {row for row, _ in node.active}
        # theta and -theta take mirrored paths: the first row may as well enter at its upper side.
        open_ = [side for side in self._sides if side[0] not in within]
        distance = {side: self._gap(side, node.w) / self._norm[side[0]] for side in open_}
        for side in open_:
            if not node.steps and side[1] < 0:
                continue
            nearest = [distance[side] - distance[other] for other in open_ if other != side]
            found = self._narrowed(node, [distance[side], *nearest])
            if found is not None:
                held, cloud = found
                start = np.zeros(self._size)
                yield from self._steps(_Node(node.steps, node.active, node.w, node.u, held, cloud, side, start))

    def _steps(self, node: _Node) -> Iterator[_Node]:
        """Follow a row that enters by one step: it is in, or the row that blocks it is dropped."""
        side, entering = node.row, node.entering
        if side is None or entering is None:
            return
        p = self._normal(side)
        normals = np.array([self._normal(each) for each in node.active]).reshape(-1, self._n).T
        t = np.linalg.lstsq(normals, p, rcond=None)[0] if node.active else np.zeros(0)
        e = p - normals @ t if len(node.active) < self._n else np.zeros(self._n)
        lengths: dict[int, Array] = {j: node.u[j] / t[j] for j in range(len(t)) if t[j] > 0.0}
        if len(node.active) < self._n:
            lengths[-1] = self._gap(side, node.w) / (e @ e)
        for which, length in lengths.items():
            found = self._narrowed(node, [other - length for j, other in lengths.items() if j != which])
            if found is None:
                continue
            held, cloud = found
            self._cones[node.steps + 1] += 1
            u, w = node.u - np.outer(t, length), node.w + np.outer(e, length)
            total = entering + length
            if which < 0:
                u = np.vstack([u, total])
                yield _Node(node.steps + 1, (*node.active, side), w, u, held, cloud)
            else:
                left = (*node.active[:which], *node.active[which + 1 :])
                yield _Node(node.steps + 1, left, w, np.delete(u, which, axis=0), held, cloud, side, total)

    def _narrowed(self, node: _Node, comparisons: list[Array]) -> tuple[Array, Array] | None:
        """Add comparisons, each >= 0, to a path's cone; None if it has no inside then."""
        if not comparisons:
            return node.held, node.cloud
        new = np.array(comparisons)
        size = np.linalg.norm(new, axis=1, keepdims=True)
        new = np.where(size > 1e-12, new / np.maximum(size, 1e-12), 0.0)
        held = np.vstack([node.held, new])
        cloud = node.cloud[(node.cloud @ new.T > THINNEST).all(axis=1)]
        if not len(cloud):
            theta, margin = self._inside(held)
            if margin <= THINNEST:
                return None
            cloud = theta[None]
        return held, cloud

    def _inside(self, held: Array) -> tuple[Array, float]:
        """Centre and radius of the largest ball in a cone, within the unit box (all rows have length 1)."""
        self._programs += 1
        rows = np.hstack([-held, np.ones((len(held), 1))])
        cost = np.append(np.zeros(self._size), -1.0)
        box = [(-1.0, 1.0)] * self._size + [(None, 1.0)]
        result = linprog(cost, A_ub=rows, b_ub=np.zeros(len(held)), bounds=box, method="highs", options=_OPTIONS)
        if result.status != 0:
            raise RuntimeError(f"iteration bound: a linear program ended as {result.message}")
        theta = np.array(result.x[:-1])
        return theta, float((held @ theta).min())  # what the point keeps to, not what it is said to keep to
