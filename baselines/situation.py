"""What a baseline is given at one control cycle, in numbers: the same rows and bounds that a formulation gets."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from ..formulations import Tick
from ..formulations.buffered import BufferedFunction
from ..formulations.inputs import complete_inputs
from .linear import factor

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Mode
    from ..robots import Robot
    from .base import Baseline

    Array = NDArray[np.float64]

_OBSERVED: Final = ("J_free", "J_fixed", "qd_lo", "qd_hi")


@dataclass(frozen=True)
class Situation:
    """One control cycle.

    Attributes
    ----------
    inputs : dict of str to ndarray
        Run-time inputs by name, shapes (size,): `q`, `v`, `v_fixed`, `dt`, the limits, and the baseline's own.
    J_free, J_fixed : ndarray, shapes (m_free, nv) and (m_fixed, nv)
        Rows that the hand guides, and that the mode locks, along the mode's axes.
    qd_lo, qd_hi : ndarray, shape (nv,)
        Joint velocity bounds [rad/s or m/s].
    extras : dict of str to ndarray
        What the baseline asked for by `Baseline.ingredients`, by name.
    """

    inputs: Mapping[str, Array]
    J_free: Array
    J_fixed: Array
    qd_lo: Array
    qd_hi: Array
    extras: Mapping[str, Array]

    @property
    def nv(self) -> int:
        """Number of joints."""
        return len(self.qd_lo)

    @property
    def q(self) -> Array:
        """Joint positions, shape (nv,) [rad or m]."""
        return self.inputs["q"]

    @property
    def v(self) -> Array:
        """Velocity that the hand asks for, shape (m_free,) [m/s, rad/s]."""
        return self.inputs["v"]

    @property
    def v_fixed(self) -> Array:
        """Velocity of the locked rows, shape (m_fixed,), zero unless drift is corrected [m/s, rad/s]."""
        return self.inputs["v_fixed"]

    @property
    def dt(self) -> float:
        """Control period [s]."""
        return float(self.inputs["dt"][0])

    @property
    def tasks(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """The locked rows, then the hand's: (J, xd) each, first priority first (thesis 4.2.2)."""
        return (self.J_fixed, self.v_fixed), (self.J_free, self.v)

    @cached_property
    def middle(self) -> Array:
        """Middle of each joint's range, shape (nv,); of one without limits, where it is [rad or m]."""
        middle: Array = np.where(self.limited, 0.5 * (self._finite("q_min") + self._finite("q_max")), self.q)
        return middle

    @cached_property
    def limited(self) -> NDArray[np.bool_]:
        """Which joints have both position limits, shape (nv,)."""
        limited: NDArray[np.bool_] = np.isfinite(self.inputs["q_min"]) & np.isfinite(self.inputs["q_max"])
        return limited

    def _finite(self, name: str) -> Array:
        limit: Array = np.where(self.limited, self.inputs[name], 0.0)
        return limit

    def over(self, qd: Array, tolerance: float = 0.0) -> Array:
        """How far each joint exceeds its bound, shape (nv,), at most zero where it does not [rad/s or m/s]."""
        return np.asarray(np.maximum(qd - self.qd_hi, self.qd_lo - qd) - tolerance)

    def nearest(self, qd: Array) -> Array:
        """`qd` with every joint at its bound where it exceeds it, shape (nv,)."""
        return np.clip(qd, self.qd_lo, self.qd_hi)

    def sigma_min(self) -> float:
        """Smallest singular value of the guided rows within the null space of the locked ones."""
        Z = factor(self.J_fixed).null
        if self.J_free.shape[0] > Z.shape[1]:
            return 0.0
        return float(np.linalg.svd(self.J_free @ Z, compute_uv=False)[-1])


class Observer:
    """Evaluates `Situation` at a state.

    Not to be shared between threads: it owns the buffers that it computes in. Results are copies.

    Parameters
    ----------
    baseline : Baseline
        Names the bounds, and what else it needs.
    robot : Robot
        The arm.
    mode : Mode
        Its motion mode.
    """

    def __init__(self, baseline: Baseline, robot: Robot, mode: Mode) -> None:
        tick = Tick(robot, mode, baseline.bounds)
        _ = tick.q, tick.v, tick.v_fixed, tick.dt
        extras = baseline.ingredients(tick)
        results = {name: getattr(tick, name) for name in _OBSERVED} | {f"extra {name}": e for name, e in extras.items()}
        self.mode: Final = mode
        self.inputs: Final = tick.inputs
        self._function: Final = BufferedFunction(
            "observe", {given.name: given.symbol for given in self.inputs}, results
        )

    def __call__(self, given: Mapping[str, ArrayLike]) -> Situation:
        """Evaluate at a state.

        Raises
        ------
        InputError
            Naming an input that is unknown, missing, of the wrong size, not finite or out of its range.
        """
        for name, value in complete_inputs(self.inputs, given, self.mode).items():
            self._function.given[name][:] = value
        found = self._function.copies()
        return Situation(
            inputs={name: value.copy() for name, value in self._function.given.items()},
            J_free=found["J_free"],
            J_fixed=found["J_fixed"],
            qd_lo=found["qd_lo"][:, 0],
            qd_hi=found["qd_hi"][:, 0],
            extras={name.removeprefix("extra "): e for name, e in found.items() if name.startswith("extra ")},
        )
