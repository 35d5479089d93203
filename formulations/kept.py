"""Whether a command keeps the joint bounds and the locked rows: measured alike, whoever computed it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# What the application promises of the locked rows, relative to the speed they compensate [-].
FIXED_TOLERANCE: Final = 1e-9
# Where less than this is compensated in a locked row, it is judged absolutely [m/s, rad/s].
FIXED_FLOOR: Final = 1.0
# What a joint velocity may exceed its bounds by [rad/s or m/s]: a thousandth of the encoder noise of a good arm over
# 1 ms, and above the primal tolerance of an interior-point solver asked for 1e-9.
BOUND_TOLERANCE: Final = 1e-8


@dataclass(frozen=True)
class Kept:
    """How far a command is off.

    Attributes
    ----------
    fixed_error : float
        Largest error of a locked row; infinite where the command is not finite [m/s, rad/s].
    bound_violation : float
        Largest excess over a joint velocity bound; infinite likewise [rad/s or m/s].
    joint_bounds, locked_rows : str
        One sentence where they are exceeded by more than is tolerated, else empty.
    """

    fixed_error: float
    bound_violation: float
    joint_bounds: str
    locked_rows: str

    @classmethod
    def of(cls, qd: Array, J_fixed: Array, v_fixed: Array, qd_lo: Array, qd_hi: Array) -> Kept:
        """Measure a command, shape (nv,); the locked rows are to have the velocities `v_fixed`."""
        if not np.isfinite(qd).all():
            return cls(np.inf, np.inf, "", "")
        residual = np.abs(J_fixed @ qd - v_fixed)
        share = np.abs(J_fixed) @ np.abs(qd) + np.abs(v_fixed)
        # Methods, not functions: this is called at every tick, and half of such a function's time is on the way to it.
        fixed_error = float(residual.max(initial=0.0))
        bound_violation = float(np.maximum(qd - qd_hi, qd_lo - qd).max(initial=0.0))
        off = bool((residual > FIXED_TOLERANCE * np.maximum(share, FIXED_FLOOR)).any())
        return cls(
            fixed_error,
            bound_violation,
            f"a joint exceeds its velocity bound by {bound_violation:.1e}" if bound_violation > BOUND_TOLERANCE else "",
            f"a locked row is off by {fixed_error:.1e}" if off else "",
        )
