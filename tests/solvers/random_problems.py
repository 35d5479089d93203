"""Random QPs of many kinds, with dependent rows, ties and bad scaling on purpose."""

from dataclasses import dataclass

import numpy as np

from kinqp.solvers import QP

INF = np.inf
KINDS = ("strict", "diagonal", "flat", "linear", "nearly-flat")
SHARES = (0.4, 0.15, 0.25, 0.1, 0.1)


@dataclass(frozen=True)
class RandomProblem:
    """A QP; `feasible` is False where its constraints may contradict each other."""

    qp: QP
    kind: str
    scaled: bool
    feasible: bool

    @property
    def strictly_convex(self) -> bool:
        return self.kind not in ("flat", "linear")

    @property
    def well_conditioned(self) -> bool:
        return self.kind == "strict" and not self.scaled


def draw(rng: np.random.Generator, largest: int = 60) -> RandomProblem:
    """Draw a problem with up to `largest` variables; four in ten have small integers as data, so that rows tie."""
    n = int(rng.integers(1, 1 + (largest if rng.random() < 0.6 else min(8, largest))))
    integer = bool(rng.random() < 0.4)
    kind = str(rng.choice(KINDS, p=SHARES))
    H, g = _hessian(rng, kind, n, integer), _numbers(rng, integer, n)
    m = int(rng.integers(0, 2 * n + 4)) if rng.random() < 0.85 else 0
    p = int(rng.integers(0, n // 2 + 1)) if rng.random() < 0.4 else 0
    C, A = _rows(rng, integer, m, n), _rows(rng, integer, p, n)
    inside = rng.integers(-2, 3, n).astype(float) if integer else rng.normal(size=n)
    ties = float(rng.choice([0.0, 0.3, 1.0]))
    b = A @ inside
    l, u = _bounds(rng, integer, ties, C @ inside)
    lb, ub = _bounds(rng, integer, ties, inside)
    if rng.random() < 0.3:
        lb[:], ub[:] = -INF, INF
    feasible = bool(rng.random() >= 0.08)
    if not feasible and m:
        i = rng.integers(m)
        l[i] = u[i] = C[i] @ inside + 10 * rng.normal()
    elif not feasible:
        b = b + rng.normal(size=p)
    scaled = bool(rng.random() < 0.15)
    if scaled:
        s, f, e = (10.0 ** rng.uniform(-4, 4, size) for size in (n, m, p))
        H, g, A, C = H * np.outer(s, s), g * s, A * s * e[:, None], C * s * f[:, None]
        b, l, u, lb, ub = b * e, l * f, u * f, lb / s, ub / s
    return RandomProblem(QP(H=H, g=g, A=A, b=b, C=C, l=l, u=u, lb=lb, ub=ub), kind, scaled, feasible)


def _numbers(rng: np.random.Generator, integer: bool, *shape: int) -> np.ndarray:
    return rng.integers(-2, 3, size=shape).astype(float) if integer else rng.normal(size=shape)


def _hessian(rng: np.random.Generator, kind: str, n: int, integer: bool) -> np.ndarray:
    if kind == "strict":
        root = _numbers(rng, integer, n, n)
        return root.T @ root + 0.1 * np.eye(n)
    if kind == "diagonal":
        return np.diag(10.0 ** rng.uniform(-4, 4, n))
    if kind == "nearly-flat":
        root = rng.normal(size=(max(1, n // 2), n))
        return root.T @ root + 10.0 ** rng.uniform(-8, -4) * np.eye(n)
    root = _numbers(rng, integer, int(rng.integers(0, n + 1)) if kind == "flat" else 0, n)
    return root.T @ root


def _rows(rng: np.random.Generator, integer: bool, count: int, n: int) -> np.ndarray:
    """Rows, in half of the cases with copies and combinations of each other."""
    rows = _numbers(rng, integer, count, n)
    if count > 1 and rng.random() < 0.5:
        for _ in range(int(rng.integers(1, count))):
            i, j, k = rng.integers(0, count, 3)
            rows[i] = rows[j] + int(rng.integers(-1, 2)) * rows[k]
    return rows


def _bounds(rng: np.random.Generator, integer: bool, ties: float, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds around `value`, some of them touching it, coinciding, or absent."""
    size = len(value)
    below, above = (
        (rng.integers(0, 3, size) if integer else rng.random(size)) * (rng.random(size) >= ties * rng.random())
        for _ in range(2)
    )
    lower, upper = value - below, value + above
    lower[rng.random(size) < rng.choice([0.0, 0.5])] = -INF
    upper[rng.random(size) < 0.4] = INF
    return lower, upper
