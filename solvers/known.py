"""A QP together with its answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .solution import Status

if TYPE_CHECKING:
    import numpy.typing as npt

    from .qp import QP
    from .validation import Array


@dataclass(frozen=True, slots=True, eq=False)
class KnownQP:
    """A QP and its answer.

    Parameters
    ----------
    name
        Kebab-case, unique.
    description
        What is special about it, in one line.
    qp
        The problem, with a feasible start wherever one exists.
    status
        What a correct solver reports.
    x, y, z, z_box
        A solution and its multipliers; None when there is no solution.
    x_unique, dual_unique
        Whether any correct solver must return these very numbers.
    accuracy
        How close to x, and relatively to the multipliers, an interior-point method at tolerance 1e-9 comes.
    """

    name: str
    description: str
    qp: QP
    status: Status = Status.SOLVED
    x: Array | None = None
    y: Array | None = None
    z: Array | None = None
    z_box: Array | None = None
    x_unique: bool = True
    dual_unique: bool = True
    accuracy: float = 1e-7


def known_solution(
    name: str,
    description: str,
    qp: QP,
    x: npt.ArrayLike,
    y: npt.ArrayLike = (),
    z: npt.ArrayLike = (),
    z_box: npt.ArrayLike | None = None,
    *,
    x_unique: bool = True,
    dual_unique: bool = True,
    accuracy: float = 1e-7,
) -> KnownQP:
    """Write down a solvable problem; the fields are those of `KnownQP`."""
    box = np.zeros(qp.n) if z_box is None else z_box
    x, y, z, box = (np.array(value, dtype=np.float64) for value in (x, y, z, box))
    return KnownQP(name, description, qp, Status.SOLVED, x, y, z, box, x_unique, dual_unique, accuracy)
