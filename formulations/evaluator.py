"""A lowered formulation in numbers: inputs checked, QP data out, without going through CasADi's slow containers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from ..solvers import QP
from .buffered import BufferedFunction
from .command_check import Limits
from .inputs import complete_inputs
from .lowering import DATA, Lowered

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ..solvers import Solution
    from .tick_inputs import Input

    Array = NDArray[np.float64]

_OBSERVED: Final = ("J_free", "J_fixed", "J_bar", "qd_lo", "qd_hi")
# A row counts as active when its multiplier carries more than this share of the objective's gradient.
_ACTIVE_SHARE: Final = 1e-6
# ... and is closer to its side than what a drive resolves [rad/s or m/s].
_ACTIVE_SLACK: Final = 1e-6


@dataclass(frozen=True)
class Instance:
    """A formulation's QP at one state, and what is needed to use and to judge its answer.

    Attributes
    ----------
    qp : QP
        The numbers.
    K, k : ndarray, shapes (nv, n) and (nv,)
        The command is K x + k.
    J_free, J_fixed, J_bar : ndarray, shapes (m_free, nv), (m_fixed, nv), (m_free, nv)
        Guided and locked rows of the Jacobian, and the guided ones within the null space of the locked ones.
    qd_lo, qd_hi : ndarray, shape (nv,)
        Joint velocity bounds [rad/s or m/s].
    v, v_fixed : ndarray, shapes (m_free,) and (m_fixed,)
        What was asked of the two [m/s, rad/s].
    stop : ndarray, shape (nv,)
        Command of the safe stop [rad/s or m/s].
    limits : Limits
        What the command is judged by.
    """

    qp: QP
    K: Array
    k: Array
    J_free: Array
    J_fixed: Array
    J_bar: Array
    qd_lo: Array
    qd_hi: Array
    v: Array
    v_fixed: Array
    stop: Array
    limits: Limits


class Evaluator:
    """Evaluates a lowered formulation at a state.

    Not to be shared between threads: it owns the buffers that it computes in. Results are copies.

    Parameters
    ----------
    lowered : Lowered
        What to evaluate.
    """

    def __init__(self, lowered: Lowered) -> None:
        self.lowered: Final = lowered
        tick = lowered.tick
        # Also what the formulation itself does not use: its command is judged against the limits all the same.
        observed = {name: getattr(tick, name) for name in _OBSERVED} | {"v_fixed": tick.v_fixed}
        observed["stop"] = tick.qd_brake if lowered.brakes else ca.SX.zeros(tick.nv, 1)
        data = dict(zip(DATA, lowered.function(*(given.symbol for given in lowered.inputs)), strict=True))
        self.inputs: Final[tuple[Input, ...]] = tick.inputs
        outputs = data | {name: value for name, value in observed.items() if name != "v_fixed"}
        self._function: Final = BufferedFunction(
            "evaluate", {given.name: given.symbol for given in self.inputs}, outputs
        )

    def __call__(self, **inputs: ArrayLike) -> Instance:
        """Evaluate at a state.

        Parameters
        ----------
        **inputs : array_like
            `q` and `v` always, and whatever else the formulation asks for; all other inputs have defaults.

        Raises
        ------
        InputError
            Naming an input that is unknown, missing, of the wrong size, not finite or out of its range.
        """
        given = self._function.given
        for name, value in complete_inputs(self.inputs, inputs, self.lowered.mode).items():
            given[name][:] = value
        r = self._function.copies()
        columns = {name: r[name][:, 0] for name in ("g", "b", "l", "u", "lb", "ub", "k", "qd_lo", "qd_hi", "stop")}
        start = r["x_feasible"]
        qp = QP.trusted(
            H=r["H"], g=columns["g"], A=r["A"], b=columns["b"], C=r["C"], l=columns["l"], u=columns["u"],
            lb=columns["lb"], ub=columns["ub"], x_feasible=start[:, 0] if start.size else None,
        )  # fmt: skip
        return Instance(
            qp, r["K"], columns["k"], r["J_free"], r["J_fixed"], r["J_bar"], columns["qd_lo"], columns["qd_hi"],
            given["v"].copy(), given["v_fixed"].copy(), columns["stop"], self._limits(given),
        )  # fmt: skip

    def _limits(self, given: Mapping[str, Array]) -> Limits:
        q, q_min, q_max, qd_max, qdd_max = (given[name].copy() for name in ("q", "q_min", "q_max", "qd_max", "qdd_max"))
        last = given["qd_prev"].copy() if "qd_prev" in given else None
        return Limits(q, q_min, q_max, qd_max, qdd_max, float(given["dt"][0]), last)

    def active_rows(self, qp: QP, solution: Solution) -> tuple[str, ...]:
        """Names of the rows that hold the solution back, each with its side, as in "joint limits[3] upper"."""
        gradient = np.abs(qp.H @ solution.x) + np.abs(qp.g)
        least = _ACTIVE_SHARE * float(np.max(gradient, initial=0.0)) + 1e-12
        rows = self.lowered.rows
        names: list[str] = []
        for labels, multipliers, value, lower, upper in (
            (rows.inequalities, solution.z, qp.C @ solution.x, qp.l, qp.u),
            (rows.box, solution.z_box, solution.x, qp.lb, qp.ub),
        ):
            # Where nothing is lost the gradient is zero, and an interior point's tiny multipliers are large beside it.
            slack = np.where(multipliers > 0.0, upper - value, value - lower)
            names += [
                f"{labels[i]} {'upper' if multipliers[i] > 0.0 else 'lower'}"
                for i in np.flatnonzero((np.abs(multipliers) > least) & (slack < _ACTIVE_SLACK))
            ]
        return tuple(names)
