"""Small random QPs near zero: dependent rows with noise in their bounds, rows of zeros, optima of cost zero."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from kinqp.solvers import QP

INF = np.inf
KINDS = ("strict", "diagonal", "flat", "linear", "costless", "nearly-flat")
SHARES = (0.35, 0.15, 0.25, 0.1, 0.05, 0.1)

Numbers = Callable[..., np.ndarray]


@dataclass(frozen=True)
class NoisyProblem:
    """A QP; `noise` is the most by which a bound is off, times the row's absolute entries."""

    qp: QP
    kind: str
    noise: float


def draw(rng: np.random.Generator) -> NoisyProblem:
    """Draw a problem with one to six variables; in half of them data are small integers."""
    n = int(rng.integers(1, 7))
    integer = bool(rng.random() < 0.5)

    def numbers(*shape: int) -> np.ndarray:
        return rng.integers(-2, 3, size=shape).astype(float) if integer else rng.normal(size=shape)

    kind = str(rng.choice(KINDS, p=SHARES))
    H, g = _hessian(rng, kind, n, numbers), np.zeros(n) if kind == "costless" else numbers(n)
    inside = numbers(n) * (rng.random() >= 0.25)
    if rng.random() < 0.2:
        g = -H @ inside
    p = int(rng.integers(0, n + 2)) if rng.random() < 0.6 else 0
    m = int(rng.integers(0, 2 * n + 3)) if rng.random() < 0.75 else 0
    A, C = _rows(rng, numbers, p, n), _rows(rng, numbers, m, n)
    if p and m and rng.random() < 0.4:
        C[rng.integers(m)] = A[rng.integers(p)] * rng.choice([1, -1, 2, 0.5])
    b = A @ inside
    l, u = _bounds(rng, integer, C @ inside)
    lb, ub = _bounds(rng, integer, inside)
    if rng.random() < 0.4:
        lb[:], ub[:] = -INF, INF
    noise = float(10 ** rng.uniform(-17, -9)) if rng.random() < 0.8 else 0.0
    shift = _noise(rng, noise, C)
    b, l, u = b + _noise(rng, noise, A), l + shift, u + (_noise(rng, noise, C) if rng.random() < 0.5 else shift)
    if rng.random() < 0.12 and p + m:
        gap = float(10 ** rng.uniform(-6, 1))
        if p and rng.random() < 0.5:
            b[rng.integers(p)] += gap
        elif m:
            i = int(rng.integers(m))
            l[i] = u[i] = C[i] @ inside + gap
    e, f = (10.0 ** rng.integers(-4, 5, count) if rng.random() < 0.2 else np.ones(count) for count in (p, m))
    A, b, C, l, u = A * e[:, None], b * e, C * f[:, None], l * f, u * f
    return NoisyProblem(QP.trusted(H=H, g=g, A=A, b=b, C=C, l=l, u=u, lb=lb, ub=ub), kind, noise)


def contradiction(qp: QP) -> float:
    """Return by how much rows contradict each other, by HiGHS.

    The least t for which some x is out of no row by more than t times the row's absolute entries; t if it has none.
    """
    size = np.abs(qp.stacked).sum(axis=1)
    size[size == 0] = 1
    rows, above, below = qp.stacked / size[:, None], qp.upper / size, qp.lower / size
    up, down = np.isfinite(above), np.isfinite(below)
    sides = np.vstack((rows[up], -rows[down]))
    if not len(sides):
        return 0.0
    answer = linprog(
        np.append(np.zeros(qp.n), 1.0),
        A_ub=np.column_stack((sides, -np.ones(len(sides)))),
        b_ub=np.concatenate((above[up], -below[down])),
        bounds=[(None, None)] * qp.n + [(0, None)],
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return float(answer.x[-1])


def _hessian(rng: np.random.Generator, kind: str, n: int, numbers: Numbers) -> np.ndarray:
    if kind == "strict":
        root = numbers(n, n)
        return root.T @ root + 0.1 * np.eye(n)
    if kind == "diagonal":
        return np.diag(10.0 ** rng.uniform(-4, 4, n))
    if kind == "nearly-flat":
        root = rng.normal(size=(max(1, n // 2), n))
        return root.T @ root + 10.0 ** rng.uniform(-8, -4) * np.eye(n)
    root = numbers(int(rng.integers(0, n + 1)) if kind == "flat" else 0, n)
    return root.T @ root


def _rows(rng: np.random.Generator, numbers: Numbers, count: int, n: int) -> np.ndarray:
    """Rows, most often with sums of others among them, sometimes with one of zeros."""
    rows = numbers(count, n)
    if count > 1 and rng.random() < 0.7:
        for _ in range(int(rng.integers(1, count))):
            i, j, k = rng.integers(0, count, 3)
            rows[i] = rows[j] + int(rng.integers(-1, 2)) * rows[k]
    if count and rng.random() < 0.2:
        rows[rng.integers(count)] = 0
    return rows


def _bounds(rng: np.random.Generator, integer: bool, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds around `value`, some of them touching it, coinciding, or absent."""
    size, ties = len(value), float(rng.choice([0.0, 0.3, 1.0]))
    below, above = (
        (rng.integers(0, 3, size) if integer else rng.random(size)) * (rng.random(size) >= ties * rng.random())
        for _ in range(2)
    )
    lower, upper = value - below, value + above
    lower[rng.random(size) < rng.choice([0.0, 0.5])] = -INF
    upper[rng.random(size) < 0.4] = INF
    return lower, upper


def _noise(rng: np.random.Generator, size: float, rows: np.ndarray) -> np.ndarray:
    entries = np.abs(rows).sum(axis=1)
    noise: np.ndarray = size * rng.uniform(-1, 1, len(rows)) * np.where(entries > 0, entries, 1)
    return noise
