"""What a solution and a proof of infeasibility must satisfy, in NumPy from the definitions: nothing of ours is used.

All values are relative, in variables scaled to a unit Hessian diagonal or, where that is zero, to unit columns.
"""

import numpy as np

from kinqp.solvers import QP

PROOF = 1e-7
#: Rounding next to zero is relative to each x at this size, at least [unit of x].
LEAST = 1e-4


def optimality(qp: QP, x: np.ndarray, y: np.ndarray, z: np.ndarray, z_box: np.ndarray) -> float:
    """Return the worst of violation, stationarity and complementarity; infinite where something is not finite."""
    if not all(np.isfinite(vector).all() for vector in (x, y, z, z_box)):
        return np.inf
    unit = _units(qp)
    multipliers = np.concatenate((y, z, z_box))
    pull = qp.stacked.T @ multipliers
    products = unit * (
        np.abs(qp.H) @ np.maximum(np.abs(x), LEAST) + np.abs(qp.g) + np.abs(qp.stacked).T @ np.abs(multipliers)
    )
    stationarity = _ratio(np.abs(unit * (qp.H @ x + qp.g + pull)).max(), products.max())

    value, reach = qp.stacked @ x, _reach(qp, x, unit)
    side = np.where(multipliers < 0, qp.lower, qp.upper)
    used = (multipliers != 0) & (qp.lower != qp.upper)
    if not np.isfinite(side[used]).all():
        return np.inf
    slack = np.abs(multipliers * (value - np.where(used, side, value))).max(initial=0)
    terms = np.abs(multipliers) * np.maximum(reach, np.where(used, np.abs(np.where(used, side, 0)), 0))
    size = max(terms.max(initial=0), np.abs(qp.H @ x * x).max(), np.abs(qp.g * x).max())
    return max(violation(qp, x), stationarity, _ratio(slack, size))


def violation(qp: QP, x: np.ndarray) -> float:
    """Return how far outside x is, relative to the bound or to what the row reaches at the length of x."""
    value = qp.stacked @ x
    outside = np.maximum(np.maximum(qp.lower - value, value - qp.upper), 0)
    bound = np.abs(np.where(value > qp.upper, qp.upper, qp.lower))
    size = np.maximum(_reach(qp, x, _units(qp)), np.where(np.isfinite(bound), bound, 0))
    return float(np.where(outside > 0, outside / np.where(size > 0, size, 1), 0).max(initial=0))


def cost_size(qp: QP, x: np.ndarray) -> float:
    """Return what the rounding of the cost at x is relative to: its terms at a point one unit farther out."""
    size = np.abs(x) + _units(qp)
    return float(size @ np.abs(qp.H) @ size + np.abs(qp.g) @ size)


def proves_infeasible(qp: QP, y: np.ndarray, z: np.ndarray, z_box: np.ndarray) -> bool:
    """Whether ``A'y + C'z + z_box = 0`` although the bounds demand a negative value of it."""
    multipliers = np.concatenate((y, z, z_box))
    used = multipliers != 0
    sides = np.where(multipliers < 0, qp.lower, qp.upper)[used] * multipliers[used]
    total, size = qp.stacked.T @ multipliers, np.abs(qp.stacked).T @ np.abs(multipliers)
    return bool(np.abs(total).max() <= PROOF * size.max() and sides.sum() < -1e-10 * np.abs(sides).sum())


def proves_unbounded(qp: QP, direction: np.ndarray) -> bool:
    """Whether the direction is flat, descends, and leaves no side."""
    length = np.abs(direction).max()
    move, slack = qp.stacked @ direction, PROOF * length * np.abs(qp.stacked).max(axis=1)
    flat = (np.abs(qp.H @ direction) <= PROOF * length * np.abs(qp.H).max(axis=1)).all()
    stays = not (((move > slack) & (qp.upper < np.inf)) | ((move < -slack) & (qp.lower > -np.inf))).any()
    return bool(flat and stays and qp.g @ direction < 0)


def _units(qp: QP) -> np.ndarray:
    curvature = np.diag(qp.H)
    column = np.abs(qp.stacked[: qp.m_eq + qp.m_ineq]).max(axis=0, initial=0)
    size = np.where(curvature > 0, np.sqrt(np.abs(curvature)), column)
    return 1 / np.where(size > 0, size, 1)


def _reach(qp: QP, x: np.ndarray, unit: np.ndarray) -> np.ndarray:
    length = max(np.abs(x / unit).max(), np.where(np.diag(qp.H) > 0, np.abs(qp.g * unit), 0).max())
    reach: np.ndarray = np.abs(qp.stacked) @ np.maximum(unit * length, LEAST)
    return reach


def _ratio(value: float, size: float) -> float:
    return float(value / size) if size > 0 else float(value)
