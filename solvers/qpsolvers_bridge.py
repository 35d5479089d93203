"""``qpsolvers:<name>``: every solver that the library qpsolvers (Caron et al.) finds installed, by its one call."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np

from .certificates import FarkasCertificate, UnboundedRay
from .families import Family
from .one_sided import OneSided, require_numbers
from .options import OptionError, UnknownOptionError, flag, gap_tolerance, one_line, tried, unknown
from .qpsolvers_members import MEMBERS, Member
from .solution import RawSolution, Status
from .solver import BackendError, Solver

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from .qp import QP
    from .solution import Certificate
    from .validation import Array


class QpsolversBridge(Solver):
    """One of qpsolvers' solvers; `bridge` makes the class for each.

    qpsolvers has no set-up and no update: every solve hands over the whole problem, so a solver that could reuse its
    factorisation does not. `setup_time` is the time to convert the problem, `solve_time` that of qpsolvers' call,
    its own conversions included. Iterations are None where qpsolvers does not pass the count on (daqp, highs,
    clarabel). Claims of infeasibility come with a certificate where qpsolvers passes on what it takes (clarabel,
    osqp, piqp, scs); the rest are claims only, or plain failures where qpsolvers does not say why nothing was found
    (daqp, highs).

    Parameters
    ----------
    tolerance
        Applied to the solver's own tolerances, see `MEMBERS`. Without effect for quadprog, which has none, and for
        solvers that are not in that table.
    warm
        Start from the last solution x, for solvers that qpsolvers hands one (osqp, proxqp, scs). The answer then
        depends on the problems before.
    settings
        Further options of the solver by its own names; they override the above. They are tried at once, on a problem
        with one variable.
    """

    requires: ClassVar[tuple[str, ...]] = ("qpsolvers", "scipy")

    def __init__(
        self, *, tolerance: float = 1e-9, warm: bool = False, settings: Mapping[str, object] | None = None
    ) -> None:
        super().__init__(tolerance=tolerance)
        self._member, self._known = self._bridged()
        self.warm = flag("warm", warm)
        if self.warm and not self._known.initial:
            raise OptionError(f"{self.name}: warm must be false, because qpsolvers hands it no point to start from.")
        self._last: Array | None = None
        given = dict(settings or {})
        accepted = max(self.tolerance, self._known.least_tolerance)
        self._options: dict[str, Any] = {
            **dict.fromkeys(self._known.tolerances, accepted),
            **dict.fromkeys(self._known.gap_tolerances, gap_tolerance(accepted)),
            **self._known.settings,
            **given,
        }
        if given:
            self._try(given)

    @classmethod
    @abstractmethod
    def _bridged(cls) -> tuple[str, Member]:
        """Return qpsolvers' name of the solver, and what is known of it."""

    @final
    def _try(self, settings: Mapping[str, object]) -> None:
        if self._known.names:
            names = list(self._known.names())
            for name in settings:
                if name not in names:
                    raise UnknownOptionError(unknown(f"Setting of {self.name}", name, names))
        one = np.ones((1, 1))
        data = self._formatted({"P": one, "q": -one[0], "G": one.copy(), "h": 0.5 * one[0]})
        tried(self.name, settings, lambda: self._call(data))

    @final
    def _setup(self, qp: QP) -> None:
        self._rows = OneSided(qp, box=self._known.box)
        self._last = None
        self._update(qp)

    @final
    def _update(self, qp: QP) -> None:
        require_numbers(qp)
        A, b, G, h = self._rows.rows(qp)
        # Copies, because some of the libraries want arrays that they could write to.
        data: dict[str, Any] = {"P": qp.H.copy(), "q": qp.g.copy()}
        if len(b):
            data |= {"A": A, "b": b}
        if len(h):
            data |= {"G": G, "h": h}
        if self._known.box:
            lb, ub = self._rows.box(qp)
            if np.isfinite(lb).any() or np.isfinite(ub).any():
                data |= {"lb": lb, "ub": ub}
        self._data = self._formatted(data)

    @final
    def _solve(self, qp: QP) -> RawSolution:
        try:
            answer, remarks = self._call(self._data)
        except Exception as error:  # what so many libraries raise has nothing in common
            raise BackendError(f"{self.name} raised {type(error).__name__}: {one_line(error)}") from error
        claimed, message = self._claim(answer, remarks)
        if self.warm:
            self._last = answer.x
        vectors = self._vectors(qp, answer.y, answer.z, answer.z_box)
        y, z, z_box = vectors or (None, None, None)
        return RawSolution(
            claimed=claimed,
            x=answer.x,
            y=y,
            z=z,
            z_box=z_box,
            iterations=self._known.iterations(answer.extras) if self._known.iterations and answer.extras else None,
            certificate=self._certificate(qp, claimed, answer) if self._known.proves else None,
            own_time=self._known.own_time(answer.extras) if self._known.own_time and answer.extras else None,
            message=message,
        )

    def _formatted(self, data: dict[str, Any]) -> dict[str, Any]:
        if self._known.sparse:
            from scipy import sparse

            data |= {name: sparse.csc_matrix(data[name]) for name in "PAG" if name in data}
        return data

    def _call(self, data: dict[str, Any]) -> tuple[Any, str]:
        """Return qpsolvers' solution, and what was said in warnings."""
        import qpsolvers

        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            # A copy of the options, because some of the functions behind this add to them.
            answer = qpsolvers.solve_problem(
                qpsolvers.Problem(**data), self._member, initvals=self._last, **dict(self._options)
            )
        # Other categories are about the use of the libraries, not about this problem.
        return answer, "; ".join(str(warning.message) for warning in caught if warning.category is UserWarning)

    def _claim(self, answer: Any, remarks: str) -> tuple[Status, str]:
        """Return what the solver claims, and in which words if it is not success."""
        known, reason = self._known, remarks
        if known.word and answer.extras:
            word = known.word(answer.extras)
            claimed, reason = known.statuses.get(word, Status.FAILED), remarks or word
        elif answer.found:
            claimed = Status.SOLVED
        else:
            claimed = Status.FAILED if remarks else known.not_found
        if claimed is Status.SOLVED:
            return claimed, ""
        if not reason:
            reason = "qpsolvers does not say why" if claimed is Status.FAILED else claimed.value
        return claimed, f"{self.name} found no solution: {reason.rstrip('.')}."

    def _vectors(self, qp: QP, y: Any, z: Any, z_box: Any) -> tuple[Array, Array, Array] | None:
        """Return multipliers in our order and signs; None where some are missing."""
        parts = []
        for values, name in ((y, "b"), (z, "h"), (z_box, "lb")):
            size = len(self._data.get(name, ()))
            given = np.zeros(0) if values is None or not size else np.asarray(values, dtype=np.float64)
            if given.shape != (size,):
                return None
            parts.append(given if size or name != "lb" else np.zeros(qp.n))
        return self._rows.multipliers(qp, *parts)

    def _certificate(self, qp: QP, claimed: Status, answer: Any) -> Certificate | None:
        """Read a proof of infeasibility from the solution or, where it is apart (osqp), from the extras."""
        if claimed is Status.DUAL_INFEASIBLE:
            ray = answer.extras.get("dual_inf_cert", answer.x)
            return None if ray is None else UnboundedRay(np.array(ray, dtype=np.float64))
        if claimed is not Status.PRIMAL_INFEASIBLE:
            return None
        parts = (answer.y, answer.z, answer.z_box)
        if "prim_inf_cert" in answer.extras:
            z, y, z_box = np.split(
                answer.extras["prim_inf_cert"], np.cumsum((self._rows.inequalities, self._rows.equalities))
            )
            parts = (y, z, z_box)
        vectors = self._vectors(qp, *parts)
        return vectors and FarkasCertificate(*vectors)


@cache
def bridge(member: str) -> type[Solver]:
    """Make the class for one of qpsolvers' solvers."""
    known = MEMBERS.get(member, Member())

    @final
    class Bridged(QpsolversBridge):
        __doc__ = QpsolversBridge.__doc__

        name: ClassVar[str] = f"qpsolvers:{member}"
        handles_semidefinite: ClassVar[bool] = known.semidefinite
        detects_infeasibility: ClassVar[bool] = known.proves
        own_timer: ClassVar[str] = "set-up and solve"
        starts: ClassVar[Mapping[str, Mapping[str, object]]] = {"solution": {"warm": True}} if known.initial else {}

        @classmethod
        def _bridged(cls) -> tuple[str, Member]:
            return member, known

        @classmethod
        def _found_by(cls) -> tuple[Callable[..., type[Solver]], tuple[str, ...]]:
            return bridge, (member,)

    return Bridged


def _members() -> tuple[str, ...]:
    import qpsolvers

    return tuple(qpsolvers.available_solvers)


FAMILY = Family("qpsolvers", "qpsolvers", _members, bridge)
