"""QRQP, CasADi's primal-dual active-set method on a sparse QR factorisation (Andersson and Rawlings, 2018)."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np

from .options import count, flag, tried
from .solution import RawSolution, Status
from .solver import Solver

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .qp import QP

#: CasADi's words. It has none for a problem without a solution, on which the last one is what it says.
_STATUSES = {
    "success": Status.SOLVED,
    "Maximum number of iterations reached": Status.MAX_ITERATIONS,
    "Failed to calculate search direction": Status.FAILED,
}

_QUIET = {
    "print_iter": False, "print_header": False, "print_info": False, "print_time": False, "error_on_fail": False,
    "record_time": True,
}  # fmt: skip


@final
class CasadiQrqp(Solver):
    """CasADi's `conic` with the plug-in qrqp, which takes two-sided rows and a box as they are.

    Set up once per structure, cold-started at every solve unless told otherwise. With several dense rows it often
    exchanges active rows in circles until `max_iterations` stops it, on more than a third of random problems with 7
    variables and 14 rows; where it does not, it answers to machine precision. It does not recognise problems without a
    solution: these end as failures, as do dependent equalities.

    Parameters
    ----------
    tolerance
        Applied to constr_viol_tol and dual_inf_tol, both absolute.
    max_iterations
        Changes of the active set. CasADi's own limit is 1000, but with a dozen variables whatever is not solved after
        50 is running in circles.
    warm
        Start from the last solution and its multipliers, which also say what was active. The answer then depends on
        the problems before.
    settings
        Further options of CasADi's `conic` by their own names; they override the above.
    """

    name: ClassVar[str] = "casadi-qrqp"
    requires: ClassVar[tuple[str, ...]] = ("casadi",)
    handles_semidefinite: ClassVar[bool] = True
    starts: ClassVar[Mapping[str, Mapping[str, object]]] = MappingProxyType({"solution": {"warm": True}})

    def __init__(
        self,
        *,
        tolerance: float = 1e-9,
        max_iterations: int = 200,
        warm: bool = False,
        settings: Mapping[str, object] | None = None,
    ) -> None:
        super().__init__(tolerance=tolerance)
        self.warm = flag("warm", warm)
        self._options: dict[str, Any] = {
            **_QUIET,
            "max_iter": count("max_iterations", max_iterations),
            "constr_viol_tol": self.tolerance,
            "dual_inf_tol": self.tolerance,
            **(settings or {}),
        }
        if settings:
            tried(self.name, settings, lambda: self.function(1, 0))
        self._backend: Any = None

    def function(self, n: int, rows: int) -> Any:
        """Give CasADi's function that solves problems of this size, all matrices dense; also to generate C from."""
        import casadi

        structure = {"h": casadi.Sparsity.dense(n, n), "a": casadi.Sparsity.dense(rows, n)}
        return casadi.conic("qrqp", "qrqp", structure, self._options)

    def _setup(self, qp: QP) -> None:
        self._rows = qp.m_eq + qp.m_ineq
        self._backend = self.function(qp.n, self._rows)
        self._last: dict[str, Any] = {}
        self._update(qp)

    def _update(self, qp: QP) -> None:
        # Read at the call that solves; CasADi has nothing to prepare from numbers alone.
        rows = self._rows
        self._data = {
            "h": qp.H,
            "g": qp.g,
            "a": qp.stacked[:rows],
            "lba": qp.lower[:rows],
            "uba": qp.upper[:rows],
            "lbx": qp.lb,
            "ubx": qp.ub,
        }

    def _solve(self, qp: QP) -> RawSolution:
        answer = self._backend(**self._data, **self._last)
        stats = self._backend.stats()
        word = stats["return_status"]
        claimed = _STATUSES.get(word, Status.FAILED)
        multipliers = np.array(answer["lam_a"]).ravel()
        if self.warm:
            self._last = {"x0": answer["x"], "lam_a0": answer["lam_a"], "lam_x0": answer["lam_x"]}
        return RawSolution(
            claimed=claimed,
            x=np.array(answer["x"]).ravel(),
            y=multipliers[: qp.m_eq],
            z=multipliers[qp.m_eq :],
            z_box=np.array(answer["lam_x"]).ravel(),
            iterations=stats["iter_count"],
            own_time=stats.get("t_wall_total"),
            message="" if claimed is Status.SOLVED else f"QRQP reports: {word}.",
        )
