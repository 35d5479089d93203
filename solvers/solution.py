"""What a solver hands back, and the judgement of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from .certificates import FarkasCertificate, UnboundedRay
from .residuals import Residuals, residuals

if TYPE_CHECKING:
    import numpy.typing as npt

    from .qp import QP
    from .validation import Array

#: Largest scaled residual of an answer that counts as solved. It is three orders above the 1e-9 to which the
#: backends solve by default, so honest rounding passes, and in this library's units 1e-6 rad/s or m/s is
#: below what a drive resolves, so whatever is flagged matters.
JUDGE_TOLERANCE = 1e-6

Certificate: TypeAlias = FarkasCertificate | UnboundedRay


class Status(StrEnum):
    """How a solve ended."""

    SOLVED = "solved"
    MAX_ITERATIONS = "max_iterations"
    PRIMAL_INFEASIBLE = "primal_infeasible"
    DUAL_INFEASIBLE = "dual_infeasible"
    INACCURATE = "inaccurate"
    FAILED = "failed"
    BAD_PARAMETER = "bad_parameter"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RawSolution:
    """What a backend says, in the canonical sign convention and before it is judged.

    Missing vectors mean that there is no such number; arrays may be views of the backend's memory, they are
    copied.
    """

    claimed: Status
    x: npt.ArrayLike | None = None
    y: npt.ArrayLike | None = None
    z: npt.ArrayLike | None = None
    z_box: npt.ArrayLike | None = None
    iterations: int | None = 0
    certificate: Certificate | None = None
    message: str = ""
    own_time: float | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solution:
    """An answer to a QP together with our judgement of it.

    Stationarity reads ``H x + g + A'y + C'z + z_box = 0``; a negative entry of z or z_box means that the
    lower side is active. Vectors that the backend did not give are NaN. Only use x when ``status`` is
    ``Status.SOLVED``.

    Parameters
    ----------
    x
        Point, shape (n,).
    y, z, z_box
        Multipliers of A, C and the box, shapes (m_eq,), (m_ineq,) and (n,).
    status
        Our verdict: the claim, or INACCURATE where the claim does not survive `JUDGE_TOLERANCE`.
    claimed
        What the backend said.
    iterations
        As the backend counts them; None where it tells no count.
    setup_time, solve_time
        Time to set up or to update (whichever happened), and to solve [s].
    residuals
        Recomputed here from x and the multipliers.
    certificate
        Proof of infeasibility, if the backend offered one.
    message
        What went wrong, in one sentence; empty when nothing did.
    updated
        Whether `setup_time` is that of an update of the last set-up.
    own_time
        What the backend's own clock says the solve took [s]; None: it has none.
    """

    x: Array
    y: Array
    z: Array
    z_box: Array
    status: Status
    claimed: Status
    iterations: int | None
    setup_time: float
    solve_time: float
    residuals: Residuals
    certificate: Certificate | None = None
    message: str = ""
    updated: bool = False
    own_time: float | None = None

    @property
    def solved(self) -> bool:
        """Whether x may be used."""
        return self.status is Status.SOLVED

    @property
    def told_the_truth(self) -> bool:
        """Whether the backend's claim survived our check."""
        return self.status is self.claimed


def judge(qp: QP, raw: RawSolution, setup_time: float, solve_time: float, *, updated: bool = False) -> Solution:
    """Turn a backend's claim into a `Solution`, believing nothing that can be recomputed.

    A claim is only ever lowered, never raised: what a backend itself calls inaccurate stays so.

    Raises
    ------
    ValueError
        When a vector of the raw solution has the wrong shape.
    """
    x = _vector("x", raw.x, qp.n)
    y = _vector("y", raw.y, qp.m_eq)
    z = _vector("z", raw.z, qp.m_ineq)
    z_box = _vector("z_box", raw.z_box, qp.n)
    measured = residuals(qp, x, y, z, z_box)
    status, message = raw.claimed, raw.message
    if status is Status.SOLVED and not measured.worst_scaled <= JUDGE_TOLERANCE:
        status = Status.INACCURATE
        message = (
            f"The backend claims solved, but the scaled residuals are primal {measured.primal_scaled:.1e}, "
            f"dual {measured.dual_scaled:.1e}, gap {measured.gap_scaled:.1e} (limit {JUDGE_TOLERANCE:.0e})."
        )
    elif raw.certificate is not None and not raw.certificate.proves(qp):
        status = Status.INACCURATE
        message = f"The backend claims {raw.claimed.value}, but its certificate does not prove it."
    elif status is not Status.SOLVED and not message:
        infeasible = status in (Status.PRIMAL_INFEASIBLE, Status.DUAL_INFEASIBLE)
        proof = ", and offers no proof of it" if infeasible and raw.certificate is None else ""
        message = f"The backend claims {raw.claimed.value}{proof}."
    return Solution(
        x=x,
        y=y,
        z=z,
        z_box=z_box,
        status=status,
        claimed=raw.claimed,
        iterations=raw.iterations,
        setup_time=setup_time,
        solve_time=solve_time,
        residuals=measured,
        certificate=raw.certificate,
        message=message,
        updated=updated,
        own_time=raw.own_time,
    )


def _vector(name: str, value: npt.ArrayLike | None, size: int) -> Array:
    vector = np.full(size, np.nan) if value is None else np.array(value, dtype=np.float64)
    if vector.shape != (size,):
        raise ValueError(f"The backend returned {name} of shape {vector.shape} where ({size},) was expected.")
    vector.flags.writeable = False
    return vector
