"""Saturation in the null space made optimal: multipliers say which saturated joint to release."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from .linear import factor, size_of
from .saturation import OVER, Level, Problem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# A direction shorter than this share of the gradient is rounding, and so is a multiplier.
_FLAT: Final = 1e-10
_PASSES_PER_VARIABLE: Final = 20


def saturate_optimally(problem: Problem) -> Level:
    r"""Largest scale of the task first, least joint velocity second (Flacco, De Luca, Khatib, T-RO 2015).

    .. math::
        \max_{\dot q, s}\ s,\ \text{then}\ \min_{\dot q}\ \tfrac12\,\|\dot q\|^2\quad\text{s.t.}\quad
        J \dot q = J \dot q_0 + s\,(\dot x - J \dot q_0),\quad \dot q_{lo} \le \dot q \le \dot q_{hi},\quad
        0 \le s \le 1

    and the tasks before it unchanged. The paper states it as one QP, with a large weight on (1 - s)^2; this is that
    weight's limit, without a number to choose. Joints are saturated when a step would take them over their bound, and
    released when their Lagrange multiplier has the wrong sign. All ways there are feasible.
    """
    p = problem
    nv = len(p.start)
    if not p.wanted.any():
        # Nothing to scale; the least norm is still to be found.
        z, held, passes = _descend(p.start, p.left, None, p.lower, p.upper)
        return Level(z, 1.0, held, passes)
    lower, upper = np.append(p.lower, 0.0), np.append(p.upper, 1.0)
    # (qd, s) with J qd - s wanted unchanged, in the null space of the tasks before.
    rows = np.column_stack((p.J @ p.Z, -p.wanted))
    free = factor(rows, size_of(p.J)).null
    basis = np.zeros((nv + 1, free.shape[1]))
    basis[:nv], basis[nv] = p.Z @ free[:-1], free[-1]
    aim = np.append(np.zeros(nv), -1.0)
    z, limiting, first = _descend(np.append(p.start, 0.0), basis, aim, lower, upper)
    scale = float(z[nv])
    qd, held, second = _descend(z[:nv], p.left, None, p.lower, p.upper)
    # Those that limit the scale count as well, unless the least norm took them off their bounds again.
    bound = np.where(limiting[:nv] > 0.0, p.upper, p.lower)
    still_there = (limiting[:nv] != 0.0) & (np.abs(qd - bound) <= OVER) & (scale < 1.0)
    return Level(qd, scale, np.where(still_there, limiting[:nv], held), first + second)


@dataclass(frozen=True)
class _Projection:
    """Gradient within basis and saturation: what is left of it, and the multipliers of the saturated."""

    left: Array
    multipliers: Array


def _project(gradient: Array, basis: Array, saturated: NDArray[np.bool_]) -> _Projection:
    along = basis.T @ gradient
    held = factor(basis[saturated], 1.0)
    left = held.null @ (held.null.T @ along)
    multipliers = np.zeros(len(gradient))
    # gradient + sum of multipliers = 0 in the basis, least squares where more are saturated than need be.
    multipliers[saturated] = held.U @ ((held.V.T @ -along) / held.sigma)
    return _Projection(-(basis @ left), multipliers)


def _descend(z: Array, basis: Array, aim: Array | None, lower: Array, upper: Array) -> tuple[Array, Array, int]:
    """Minimise aim'z, or 1/2 |z|^2 without an aim, over z + span(basis) within bounds, from a feasible z.

    A primal active set: `held` are its saturated entries. Ties are broken by the smallest index, on the way in and on
    the way out (Bland's rule), so that entries that rest on two bounds' corner do not make it go in circles; a cap on
    passes stands behind that, and whatever is reached is feasible.
    """
    held = np.zeros(len(z))
    passes = 0
    for _ in range(_PASSES_PER_VARIABLE * (len(z) + 1)):
        passes += 1
        gradient = z if aim is None else aim
        size = float(np.linalg.norm(gradient))
        found = _project(gradient, basis, held != 0.0)
        direction = found.left
        if np.linalg.norm(direction) > _FLAT * size:
            with np.errstate(divide="ignore", invalid="ignore"):
                room = np.where(direction > 0.0, upper - z, lower - z) / direction
            moves = (held == 0.0) & (np.abs(direction) > _FLAT * np.max(np.abs(direction)))
            room = np.where(moves, np.maximum(room, 0.0), np.inf)
            blocking = int(np.argmin(room))
            full = np.inf if aim is not None else 1.0
            step = min(full, float(room[blocking]))
            if not np.isfinite(step):
                break
            z = z + step * direction
            if step < full:
                held[blocking] = np.sign(direction[blocking])
                z[blocking] = upper[blocking] if held[blocking] > 0.0 else lower[blocking]
            continue
        wrong = np.flatnonzero(found.multipliers * held < -_FLAT * size)
        if not len(wrong):
            break
        held[wrong[0]] = 0.0
    return z, held, passes
