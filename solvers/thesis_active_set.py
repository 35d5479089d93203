"""The primal active-set method as the thesis prints it (appendix A.3, section 4.5.3), faults included."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, final

import numpy as np

from .options import count, positive
from .solution import RawSolution, Status
from .solver import BackendError, Solver

if TYPE_CHECKING:
    from .qp import QP
    from .validation import Array

#: How far outside its constraints the start may lie, relative as in `Residuals.primal_scaled`.
START_TOLERANCE = 1e-9


@final
class ThesisActiveSet(Solver):
    """A.3 in structure, as a baseline to compare with; not a solver to rely on.

    Kept from A.3: one-sided rows ``B x <= c`` stacked as [upper; lower]; an active set started by the exact comparison
    ``B x0 == c``; a short step taken for zero; the most negative multiplier dropped; a ratio test that sees only rows
    with ``B d > 1e-6``. Changed, and nothing else:

    - A.3 writes the identity for H and x for the gradient, whatever W is passed; here they are H and ``H x + g``.
    - Equalities enter the KKT system as in eq. 4.41; A.3 leaves them out.
    - A.3 takes a step with norm below 1e-5 for zero and may stop that far from the minimiser: 1.4e-5 rad/s off on the
      thesis's own semicircle, and standing still while the hand starts to move. `tolerance` is smaller here; pass 1e-5
      for the printed behaviour.
    - A.3 loops without end when it cycles; here the loop stops after `max_iterations` passes.
    - `iterations` counts passes, that is KKT systems solved; A.3's k counts steps only.

    What follows from the kept parts: coinciding sides, dependent active rows and a flat H make the KKT system singular;
    rows with small entries are walked through; and a start that misses a bound by rounding does not have that bound in
    its active set.

    Parameters
    ----------
    tolerance
        Norm of a step that is taken for zero, in the units of x (printed: 1e-5).
    min_slope
        Smallest ``B d`` of a row that the ratio test looks at (printed: 1e-6).
    max_iterations
        Passes of the loop.
    """

    name: ClassVar[str] = "thesis-active-set"
    needs_feasible_start: ClassVar[bool] = True

    def __init__(self, *, tolerance: float = 1e-9, min_slope: float = 1e-6, max_iterations: int = 100) -> None:
        super().__init__(tolerance=tolerance)
        self.min_slope = positive("min_slope", min_slope)
        self.max_iterations = count("max_iterations", max_iterations)

    def _setup(self, qp: QP) -> None:
        # Equalities stay equalities: they enter the KKT system, not the stacked rows.
        self._upper = qp.m_eq + np.flatnonzero(np.isfinite(qp.upper[qp.m_eq :]))
        self._lower = qp.m_eq + np.flatnonzero(np.isfinite(qp.lower[qp.m_eq :]))
        self._update(qp)

    def _update(self, qp: QP) -> None:
        self._B = np.concatenate((qp.stacked[self._upper], -qp.stacked[self._lower]))
        self._c = np.concatenate((qp.upper[self._upper], -qp.lower[self._lower]))

    def _solve(self, qp: QP) -> RawSolution:
        B, c = self._B, self._c
        x = self._start(qp)
        active = B @ x == c
        for iteration in range(1, self.max_iterations + 1):
            d, y, mu = self._direction(qp, x, active)
            if float(np.linalg.norm(d)) < self.tolerance:
                if (mu >= 0.0).all():
                    return self._answer(qp, Status.SOLVED, x, y, mu, iteration)
                active[np.argmin(mu)] = False
                continue
            slope = B @ d
            seen = np.flatnonzero(~active & (slope > self.min_slope))
            steps = np.concatenate(([1.0], (c[seen] - B[seen] @ x) / slope[seen]))
            first = int(np.argmin(steps))
            x = x + steps[first] * d
            if steps[first] != 1.0:
                active[seen[first - 1]] = True
        return self._answer(qp, Status.MAX_ITERATIONS, x, y, mu, self.max_iterations)

    def _start(self, qp: QP) -> Array:
        if qp.x_feasible is None:
            if len(self._c) or qp.m_eq:
                raise BackendError("This method starts from QP.x_feasible, which is missing: give a feasible point.")
            return np.zeros(qp.n)
        x = qp.x_feasible
        size = 1.0 + np.abs(x)
        outside = (self._B @ x - self._c > START_TOLERANCE * (np.abs(self._B) @ size)).any()
        off = (np.abs(qp.A @ x - qp.b) > START_TOLERANCE * (np.abs(qp.A) @ size)).any()
        if outside or off:
            raise BackendError("This method needs a feasible start, but QP.x_feasible violates the constraints.")
        return x

    def _direction(self, qp: QP, x: Array, active: Array) -> tuple[Array, Array, Array]:
        """Solve eq. 4.41 for the step and the multipliers of equalities and rows (0 where inactive)."""
        n, m_eq = qp.n, qp.m_eq
        rows = np.concatenate((qp.A, self._B[active]))
        kkt = np.zeros((n + len(rows), n + len(rows)))
        kkt[:n, :n] = qp.H
        kkt[:n, n:] = rows.T
        kkt[n:, :n] = rows
        right = np.zeros(n + len(rows))
        right[:n] = -(qp.H @ x + qp.g)
        try:
            solution: Array = np.linalg.solve(kkt, right).astype(np.float64, copy=False)
        except np.linalg.LinAlgError:
            raise BackendError(
                f"The KKT matrix is singular with {m_eq} equalities and {int(active.sum())} active rows."
            ) from None
        if not np.isfinite(solution).all():
            raise BackendError("The solution of the KKT system is not finite.")
        mu = np.zeros(len(self._c))
        mu[active] = solution[n + m_eq :]
        return solution[:n], solution[n : n + m_eq], mu

    def _answer(self, qp: QP, claimed: Status, x: Array, y: Array, mu: Array, iterations: int) -> RawSolution:
        multipliers = np.zeros(len(qp.lower))
        multipliers[self._upper] = mu[: len(self._upper)]
        multipliers[self._lower] -= mu[len(self._upper) :]
        rows = qp.m_eq + qp.m_ineq
        return RawSolution(
            claimed=claimed,
            x=x,
            y=y,
            z=multipliers[qp.m_eq : rows],
            z_box=multipliers[rows:],
            iterations=iterations,
            message="" if claimed is Status.SOLVED else f"No convergence within {iterations} passes.",
        )
