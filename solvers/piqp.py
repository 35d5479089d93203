"""PIQP, a proximal interior-point method (Schwan, Jiang, Kuhn and Jones, CDC 2023), by its own dense API."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np

from .certificates import FarkasCertificate, UnboundedRay
from .options import apply_settings, count
from .solution import RawSolution, Status
from .solver import Solver

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .qp import QP

STATUSES = {
    "PIQP_SOLVED": Status.SOLVED,
    "PIQP_MAX_ITER_REACHED": Status.MAX_ITERATIONS,
    "PIQP_PRIMAL_INFEASIBLE": Status.PRIMAL_INFEASIBLE,
    "PIQP_DUAL_INFEASIBLE": Status.DUAL_INFEASIBLE,
    "PIQP_NUMERICS": Status.FAILED,
    "PIQP_UNSOLVED": Status.FAILED,
    "PIQP_INVALID_SETTINGS": Status.FAILED,
}

# The last two: how exactly infeasibility is proven. At PIQP's own 1e-4 most of its proofs are too coarse to
# be confirmed here; at 1e-9 they all were, on random problems.
_TOLERANCES = (
    "eps_abs",
    "eps_rel",
    "eps_duality_gap_abs",
    "eps_duality_gap_rel",
    "eps_primal_inf",
    "eps_dual_inf",
)


@final
class Piqp(Solver):
    """PIQP, which takes two-sided rows and a box as they are.

    Parameters
    ----------
    tolerance
        Applied to eps_abs, eps_rel and their like for the duality gap and for infeasibility. Unlike Clarabel, PIQP
        does not reach a gap of the tolerance squared where multipliers are large, so it is not asked to.
    max_iterations
        Interior-point iterations.
    settings
        Further settings by PIQP's own names; they override the above.
    """

    name: ClassVar[str] = "piqp"
    requires: ClassVar[tuple[str, ...]] = ("piqp",)
    handles_semidefinite: ClassVar[bool] = True
    detects_infeasibility: ClassVar[bool] = True

    def __init__(
        self,
        *,
        tolerance: float = 1e-9,
        max_iterations: int = 250,
        settings: Mapping[str, object] | None = None,
    ) -> None:
        super().__init__(tolerance=tolerance)
        self._max_iterations = count("max_iterations", max_iterations)
        self._settings = dict(settings or {})
        self._backend: Any = self._make()

    def _make(self) -> Any:
        import piqp

        backend = piqp.DenseSolver()
        backend.settings.max_iter = self._max_iterations
        backend.settings.compute_timings = True
        for name in _TOLERANCES:
            setattr(backend.settings, name, self.tolerance)
        apply_settings(self.name, backend.settings, self._settings)
        return backend

    def _setup(self, qp: QP) -> None:
        self._backend = self._make()
        # H is symmetric, so its transposed view is H in the column order that PIQP wants, without a copy.
        self._backend.setup(qp.H.T, qp.g, qp.A, qp.b, qp.C, qp.l, qp.u, qp.lb, qp.ub)

    def _update(self, qp: QP) -> None:
        self._backend.update(qp.H.T, qp.g, qp.A, qp.b, qp.C, qp.l, qp.u, qp.lb, qp.ub)

    def _solve(self, qp: QP) -> RawSolution:  # noqa: ARG002 - PIQP holds the data already
        word = self._backend.solve().name
        claimed = STATUSES.get(word, Status.FAILED)
        result = self._backend.result
        y, z, z_box = result.y, result.z_u - result.z_l, result.z_bu - result.z_bl
        certificate: FarkasCertificate | UnboundedRay | None = None
        if claimed is Status.PRIMAL_INFEASIBLE:
            certificate = FarkasCertificate(*map(np.array, (y, z, z_box)))
        elif claimed is Status.DUAL_INFEASIBLE:
            certificate = UnboundedRay(np.array(result.x))
        return RawSolution(
            claimed=claimed,
            x=result.x,
            y=y,
            z=z,
            z_box=z_box,
            iterations=result.info.iter,
            certificate=certificate,
            own_time=result.info.solve_time,
            message="" if claimed is Status.SOLVED else f"PIQP reports {word}.",
        )
