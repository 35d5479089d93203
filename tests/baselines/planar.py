"""Planar arms with unit links, small enough to work out by hand."""

import numpy as np

from kinqp.baselines import Situation

Array = np.ndarray


def planar_jacobian(q: Array) -> Array:
    """Velocity of the tip in x and y, shape (2, nv), for unit links with relative angles `q`."""
    angle = np.cumsum(q)
    return np.array([[-np.sum(np.sin(angle[i:])), np.sum(np.cos(angle[i:]))] for i in range(len(q))]).T


def situation(
    J_free: Array,
    v: Array,
    *,
    J_fixed: Array | None = None,
    bound: float | Array = 10.0,
    lower: float | Array | None = None,
    q: Array | None = None,
    dt: float = 1e-3,
    extras: dict[str, Array] | None = None,
    **inputs: object,
) -> Situation:
    """Give rows and bounds as they are; limits of +-1 rad unless told otherwise."""
    nv = J_free.shape[1]
    fixed = np.zeros((0, nv)) if J_fixed is None else J_fixed
    given = {
        "q": np.zeros(nv) if q is None else q,
        "v": np.asarray(v, dtype=float),
        "v_fixed": np.zeros(len(fixed)),
        "dt": np.array([dt]),
        "q_min": np.full(nv, -1.0),
        "q_max": np.full(nv, 1.0),
    } | {name: np.atleast_1d(np.asarray(value, dtype=float)) for name, value in inputs.items()}
    high = np.broadcast_to(np.asarray(bound, dtype=float), (nv,)).copy()
    low = -high if lower is None else np.broadcast_to(np.asarray(lower, dtype=float), (nv,)).copy()
    return Situation(given, J_free, fixed, low, high, extras or {})
