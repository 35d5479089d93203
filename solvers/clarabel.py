"""Clarabel: interior-point method with a homogeneous embedding (Goulart and Chen, 2024), by its own API."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np

from .certificates import FarkasCertificate, UnboundedRay
from .options import apply_settings, count, gap_tolerance
from .solution import RawSolution, Status
from .solver import BackendError, Solver

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy.typing as npt

    from .qp import QP
    from .validation import Array

#: Clarabel's own words. "Almost" means that only its reduced tolerances (1e-4 and worse) were met.
STATUSES = {
    "Solved": Status.SOLVED,
    "AlmostSolved": Status.INACCURATE,
    "InsufficientProgress": Status.INACCURATE,
    "PrimalInfeasible": Status.PRIMAL_INFEASIBLE,
    "DualInfeasible": Status.DUAL_INFEASIBLE,
    "AlmostPrimalInfeasible": Status.INACCURATE,
    "AlmostDualInfeasible": Status.INACCURATE,
    "MaxIterations": Status.MAX_ITERATIONS,
    "MaxTime": Status.MAX_ITERATIONS,
    "NumericalError": Status.FAILED,
    "CallbackTerminated": Status.FAILED,
    "Unsolved": Status.FAILED,
}

_TOLERANCES = ("tol_feas", "tol_infeas_abs", "tol_infeas_rel")
_GAP_TOLERANCES = ("tol_gap_abs", "tol_gap_rel")


@final
class Clarabel(Solver):
    """Clarabel on ``M x + s = r``, with equalities and coinciding sides in the zero cone.

    The sparsity pattern is that of dense H, A and C and never depends on values, so only numbers are sent between
    solves. Clarabel keeps the scaling (equilibration) of the last set-up for all later problems with the same
    structure: where the data change by orders of magnitude this costs accuracy, and `reset` before solving helps.

    Parameters
    ----------
    tolerance
        Applied to tol_feas, tol_infeas_abs and tol_infeas_rel; tol_gap_abs and tol_gap_rel follow by `gap_tolerance`.
    max_iterations
        Interior-point iterations.
    settings
        Further settings by Clarabel's own names; they override the above.
    """

    name: ClassVar[str] = "clarabel"
    requires: ClassVar[tuple[str, ...]] = ("clarabel", "scipy")
    handles_semidefinite: ClassVar[bool] = True
    detects_infeasibility: ClassVar[bool] = True
    # Its total; the parts are only printed, not told.
    own_timer: ClassVar[str] = "the solve and once more its last set-up"

    def __init__(
        self,
        *,
        tolerance: float = 1e-9,
        max_iterations: int = 200,
        settings: Mapping[str, object] | None = None,
    ) -> None:
        import clarabel

        super().__init__(tolerance=tolerance)
        options = clarabel.DefaultSettings()
        options.verbose = False
        # Presolve would drop rows, after which Clarabel refuses new data.
        options.presolve_enable = False
        # Problems of this size gain nothing from threads, and one thread is reproducible.
        options.max_threads = 1
        options.max_iter = count("max_iterations", max_iterations)
        for name in _TOLERANCES:
            setattr(options, name, self.tolerance)
        for name in _GAP_TOLERANCES:
            setattr(options, name, gap_tolerance(self.tolerance))
        apply_settings(self.name, options, settings or {})
        self._settings = options
        self._backend: Any = None

    def _setup(self, qp: QP) -> None:
        import clarabel
        from scipy import sparse

        n, size = qp.n, len(qp.lower)
        fixed = qp.lower == qp.upper
        zero = np.flatnonzero(fixed)
        upper = np.flatnonzero(np.isfinite(qp.upper) & ~fixed)
        lower = np.flatnonzero(np.isfinite(qp.lower) & ~fixed)

        # Row i of M is sign[i] times row source[i] of qp.stacked, and its right-hand side sign[i] times entry
        # side[i] of [upper; lower].
        self._source = np.concatenate((zero, upper, lower))
        self._side = np.concatenate((zero, upper, size + lower))
        self._sign = np.repeat([1.0, -1.0], (len(zero) + len(upper), len(lower)))

        # The stored entries of M, column by column, as places in qp.stacked.ravel(): A and C dense, the box
        # diagonal.
        pattern = np.ones((size, n), dtype=bool)
        pattern[qp.m_eq + qp.m_ineq :] = np.eye(n, dtype=bool)
        columns, rows = np.nonzero(pattern[self._source].T)
        self._entry = self._source[rows] * n + columns
        self._entry_sign = self._sign[rows]
        # The upper triangle of H column by column is, H being symmetric, its lower triangle row by row.
        column, row = np.tril_indices(n)
        self._triangle = column * n + row

        cones = [clarabel.ZeroConeT(len(zero))] if len(zero) else []
        if len(upper) + len(lower):
            cones.append(clarabel.NonnegativeConeT(len(upper) + len(lower)))
        P_data, M_data, r = self._numbers(qp)
        P = sparse.csc_matrix((P_data, row, _starts(column, n)), shape=(n, n))
        M = sparse.csc_matrix((M_data, rows, _starts(columns, n)), shape=(len(self._source), n))
        try:
            self._backend = clarabel.DefaultSolver(P, qp.g, M, r, cones, self._settings)
        except Exception as error:  # Clarabel raises nothing narrower
            raise BackendError(f"Clarabel refused the set-up: {error}.") from error

    def _update(self, qp: QP) -> None:
        P_data, M_data, r = self._numbers(qp)
        try:
            self._backend.update(P=P_data, q=qp.g, A=M_data, b=r)
        except Exception as error:  # Clarabel raises nothing narrower
            raise BackendError(f"Clarabel refused the update: {error}.") from error

    def _numbers(self, qp: QP) -> tuple[Array, Array, Array]:
        """Return the entries of P and M and the right-hand side."""
        return (
            qp.H.ravel()[self._triangle],
            qp.stacked.ravel()[self._entry] * self._entry_sign,
            np.concatenate((qp.upper, qp.lower))[self._side] * self._sign,
        )

    def _solve(self, qp: QP) -> RawSolution:
        answer = self._backend.solve()
        word = str(answer.status)
        claimed = STATUSES.get(word, Status.FAILED)
        # Both sides of a row add up in its one multiplier.
        weights = self._sign * np.array(answer.z)
        # With weights bincount adds floats, which its stubs do not know; the conversion copies nothing.
        multipliers = np.bincount(self._source, weights, len(qp.lower)).astype(np.float64, copy=False)
        rows = qp.m_eq + qp.m_ineq
        y, z, z_box = multipliers[: qp.m_eq], multipliers[qp.m_eq : rows], multipliers[rows:]
        certificate: FarkasCertificate | UnboundedRay | None = None
        if claimed is Status.PRIMAL_INFEASIBLE:
            certificate = FarkasCertificate(y, z, z_box)
        elif claimed is Status.DUAL_INFEASIBLE:
            certificate = UnboundedRay(np.array(answer.x))
        return RawSolution(
            claimed=claimed,
            x=answer.x,
            y=y,
            z=z,
            z_box=z_box,
            iterations=answer.iterations,
            certificate=certificate,
            own_time=answer.solve_time,
            message="" if claimed is Status.SOLVED else f"Clarabel reports {word}.",
        )


def _starts(columns: npt.NDArray[np.intp], n: int) -> npt.NDArray[np.intp]:
    """Return where each of n columns begins among entries sorted by column."""
    return np.searchsorted(columns, np.arange(n + 1))
