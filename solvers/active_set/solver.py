"""The library's own active-set method as a backend."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, final

import numpy as np

from ..certificates import FarkasCertificate, UnboundedRay
from ..options import count, flag
from ..solution import RawSolution, Status
from ..solver import Solver
from .library import load

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..qp import QP

#: In the order of ``kinqp_status``.
STATUSES = (
    Status.SOLVED,
    Status.MAX_ITERATIONS,
    Status.PRIMAL_INFEASIBLE,
    Status.DUAL_INFEASIBLE,
    Status.INACCURATE,
    Status.FAILED,
    Status.BAD_PARAMETER,
)


@final
class ActiveSet(Solver):
    """Dual active-set method in C: equalities eliminated, Hessian whitened, least distance by Goldfarb and Idnani.

    Where H is singular, proximal passes surround it. Each answer is refined on its active set and, before it is called
    solved, measured by the C code in the data as they were given. The library is built when the first solver is
    made, which needs a C compiler once.

    Parameters
    ----------
    tolerance
        Relative residual of the optimality conditions up to which an answer counts as solved; the method is exact up to
        rounding and usually stays below 1e-12.
    max_iterations
        Steps, each of which adds or drops one row, over all passes; None: 50 (m_ineq + n) + 200.
    warm
        Start from the active set of the last problem, if that was solved and had the same structure. The answer
        then depends on the problems before: where it is not unique, another one may be found.
    """

    name: ClassVar[str] = "active-set"
    requires: ClassVar[tuple[str, ...]] = ("cffi",)
    handles_semidefinite: ClassVar[bool] = True
    detects_infeasibility: ClassVar[bool] = True
    starts: ClassVar[Mapping[str, Mapping[str, object]]] = MappingProxyType({"active-set": {"warm": True}})

    def __init__(self, *, tolerance: float = 1e-9, max_iterations: int | None = None, warm: bool = False) -> None:
        super().__init__(tolerance=tolerance)
        self.max_iterations = None if max_iterations is None else count("max_iterations", max_iterations)
        self.warm = flag("warm", warm)
        self._ffi, lib = load()
        self._call = lib.kinqp_qp_solve
        self._lib = lib
        self._sizes: tuple[int, int, int] | None = None

    def _setup(self, qp: QP) -> None:
        sizes = (qp.n, qp.m_eq, qp.m_ineq)
        if sizes != self._sizes:
            self._allocate(*sizes)
        self._options.warm = 0
        self._copy(qp)

    def _update(self, qp: QP) -> None:
        self._options.warm = int(self.warm)
        self._copy(qp)

    def _allocate(self, n: int, p: int, m: int) -> None:
        """Lay out buffers that the C side points to, and NumPy's views of them."""
        ffi, lib = self._ffi, self._lib
        self._H, self._rows = np.empty((n, n)), np.empty((p + m, n))
        self._g, self._lower, self._upper = np.empty(n), np.empty(p + m + n), np.empty(p + m + n)
        self._x, self._multipliers = np.empty(n), np.empty(p + m + n)
        self._active = np.zeros(m + n, dtype=np.intc)
        # The cdata keep neither the arrays nor each other alive: all stay attributes.
        self._memory = ffi.new("double[]", -(-lib.kinqp_qp_workspace_size(n, p, m) // 8))
        H, g, rows, lower, upper, x, multipliers = (
            ffi.from_buffer("double[]", array)
            for array in (self._H, self._g, self._rows, self._lower, self._upper, self._x, self._multipliers)
        )
        self._problem = ffi.new(
            "kinqp_qp *",
            {
                "n": n,
                "p": p,
                "m": m,
                "H": H,
                "g": g,
                "A": rows,
                "b": lower,
                "C": rows + p * n,
                "l": lower + p,
                "u": upper + p,
                "lb": lower + p + m,
                "ub": upper + p + m,
            },
        )
        self._options = ffi.new("kinqp_qp_options *", lib.kinqp_qp_default_options(n, p, m))
        self._options.tolerance = self.tolerance
        if self.max_iterations is not None:
            self._options.max_iterations = self.max_iterations
        active = ffi.from_buffer("int[]", self._active)
        self._answer = ffi.new(
            "kinqp_qp_solution *",
            {"x": x, "y": multipliers, "z": multipliers + p, "z_box": multipliers + p + m, "active": active},
        )
        self._y, self._z, self._z_box = np.split(self._multipliers, [p, p + m])
        self._sizes = (n, p, m)

    def _copy(self, qp: QP) -> None:
        np.copyto(self._H, qp.H)
        np.copyto(self._g, qp.g)
        np.copyto(self._rows, qp.stacked[: len(self._rows)])
        np.copyto(self._lower, qp.lower)
        np.copyto(self._upper, qp.upper)

    def _solve(self, qp: QP) -> RawSolution:  # noqa: ARG002  # the interface has it; its data are in the buffers
        answer = self._answer
        claimed = STATUSES[self._call(self._problem, self._options, self._memory, answer)]
        if claimed is Status.SOLVED:
            return RawSolution(
                claimed=claimed, x=self._x, y=self._y, z=self._z, z_box=self._z_box, iterations=answer.iterations
            )
        return self._unsolved(claimed)

    def _unsolved(self, claimed: Status) -> RawSolution:
        answer = self._answer
        if claimed is Status.FAILED:
            return RawSolution(
                claimed=claimed,
                iterations=answer.iterations,
                message="The data hold NaN, an infinity or an impossible bound, or H is not symmetric or not convex.",
            )
        certificate: FarkasCertificate | UnboundedRay | None = None
        message = "The problem is unbounded below."
        if claimed is Status.PRIMAL_INFEASIBLE and not self._multipliers.any():
            # Bounds that cross. What two multipliers of opposite sign would prove, one multiplier per row cannot say.
            message = "A lower bound lies above its upper bound."
        elif claimed is Status.PRIMAL_INFEASIBLE:
            certificate = FarkasCertificate(self._y.copy(), self._z.copy(), self._z_box.copy())
            message = "No point satisfies the constraints."
        elif claimed is Status.DUAL_INFEASIBLE:
            certificate = UnboundedRay(self._x.copy())
        elif claimed is Status.MAX_ITERATIONS:
            message = f"No convergence within {self._options.max_iterations} iterations."
        elif not (answer.primal < np.inf):
            message = (
                "The rows seem to contradict each other, but by so little beside the rounding in them that it could "
                "not be proved; no point was found that satisfies them either."
            )
        else:
            message = (
                f"After {answer.passes} passes the relative residuals are primal {answer.primal:.1e}, "
                f"dual {answer.dual:.1e}, gap {answer.gap:.1e} (tolerance {self.tolerance:.0e})."
            )
        return RawSolution(
            claimed=claimed,
            x=self._x,
            y=self._y,
            z=self._z,
            z_box=self._z_box,
            iterations=answer.iterations,
            certificate=certificate,
            message=message,
        )
