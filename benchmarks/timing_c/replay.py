"""Python's side of the replay in C: problems packed by size, buffers, the library."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final, final

import casadi as ca
import cffi
import numpy as np

from ...solvers.active_set import ActiveSet
from ...solvers.active_set.library import sources
from ...solvers.casadi_qrqp import CasadiQrqp
from ...solvers.native import build_library, declarations

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...solvers import QP, Solver

    Array = NDArray[np.float64]

_ACTIVE_SET: Final = """
void kinqp_replay_active_set(long count, int n, int p, int m, const double *data, const unsigned char *fresh, int warm,
                             double tolerance, int max_iterations, double *problem, void *memory, double *multipliers,
                             int *active, double *seconds, int *status, double *answers);
size_t kinqp_qp_workspace_size(int n, int p, int m);
"""
_QRQP: Final = """
void kinqp_replay_qrqp(long count, int n, int rows, const double *data, const unsigned char *fresh, int warm,
                       double *problem, const double **arg, double **res, int *iw, double *w, double *lam,
                       double *seconds, int *status, double *answers);
"""


class CReplay(ABC):
    """A solver's C, fed with a series of problems.

    Parameters
    ----------
    solver : Solver
        Whose options are taken over.
    """

    def __init__(self, solver: Solver) -> None:
        self.warm: Final = bool(getattr(solver, "warm", False))
        self._packed: tuple[tuple[int, ...], list[_Series]] = ((), [])

    @final
    def seconds(self, qps: Sequence[QP], fresh: Sequence[bool]) -> Array:
        """Solve a series of problems once, in order.

        Parameters
        ----------
        qps : sequence of QP
            The problems; the same objects again are not packed again.
        fresh : sequence of bool
            Where the solver has to start from nothing.

        Returns
        -------
        ndarray, shape (len(qps),)
            Time of each [s].
        """
        key = tuple(id(qp) for qp in qps)
        if key != self._packed[0]:
            self._packed = (key, self._pack(qps, fresh))
        found = np.empty(len(qps))
        for series in self._packed[1]:
            self._run(series)
            found[series.places] = series.seconds
        return found

    @final
    def answers(self) -> list[tuple[NDArray[np.intp], NDArray[np.intc], Array]]:
        """Places in the series, status (0: solved) and x of the last run, problems of one size each."""
        return [(series.places, series.status, series.answers) for series in self._packed[1]]

    def _pack(self, qps: Sequence[QP], fresh: Sequence[bool]) -> list[_Series]:
        sizes: dict[tuple[int, int, int], list[int]] = {}
        for index, qp in enumerate(qps):
            sizes.setdefault((qp.n, qp.m_eq, qp.m_ineq), []).append(index)
        return [
            _Series(size, np.array(places), [qps[i] for i in places], [fresh[i] for i in places], self._matrix)
            for size, places in sizes.items()
        ]

    @abstractmethod
    def _run(self, series: _Series) -> None:
        """Fill in the series' times, status and answers."""

    @abstractmethod
    def _matrix(self, rows: Array) -> Array:
        """The rows of A and C in the order in which the C reads them, flat."""


class _Series:
    """Problems of one size, packed, and room for their answers."""

    def __init__(
        self,
        size: tuple[int, int, int],
        places: NDArray[np.intp],
        qps: Sequence[QP],
        fresh: Sequence[bool],
        matrix: Any,
    ) -> None:
        self.size: Final = size
        self.places: Final = places
        rows = size[1] + size[2]
        packed = [np.concatenate([qp.H.ravel(), qp.g, matrix(qp.stacked[:rows]), qp.lower, qp.upper]) for qp in qps]
        self.data: Final = np.ascontiguousarray(packed)
        self.fresh: Final = np.array(fresh, dtype=np.uint8)
        self.problem: Final = np.empty(self.data.shape[1])
        self.seconds: Final = np.empty(len(qps))
        self.status: Final = np.zeros(len(qps), dtype=np.intc)
        self.answers: Final = np.zeros((len(qps), size[0]))


@final
class _ActiveSetReplay(CReplay):
    def __init__(self, solver: ActiveSet) -> None:
        super().__init__(solver)
        self._tolerance: Final = solver.tolerance
        self._max_iterations: Final = solver.max_iterations or 0
        self._ffi, self._lib = _active_set_library()

    def _matrix(self, rows: Array) -> Array:
        return rows.ravel()

    def _run(self, series: _Series) -> None:
        ffi, (n, p, m) = self._ffi, series.size
        memory = np.empty(-(-self._lib.kinqp_qp_workspace_size(n, p, m) // 8))
        multipliers, active = np.empty(p + m + n), np.zeros(m + n, dtype=np.intc)
        self._lib.kinqp_replay_active_set(
            len(series.seconds), n, p, m, _doubles(ffi, series.data), ffi.from_buffer("unsigned char[]", series.fresh),
            int(self.warm), self._tolerance, self._max_iterations, _doubles(ffi, series.problem),
            _doubles(ffi, memory), _doubles(ffi, multipliers), ffi.from_buffer("int[]", active),
            _doubles(ffi, series.seconds), ffi.from_buffer("int[]", series.status), _doubles(ffi, series.answers),
        )  # fmt: skip


@final
class _QrqpReplay(CReplay):
    def __init__(self, solver: CasadiQrqp) -> None:
        super().__init__(solver)
        self._solver: Final = solver

    def _matrix(self, rows: Array) -> Array:
        # CasADi's matrices are stored by columns.
        return rows.ravel(order="F")

    def _run(self, series: _Series) -> None:
        n, rows = series.size[0], series.size[1] + series.size[2]
        function = self._solver.function(n, rows)
        ffi, lib = _qrqp_library(_qrqp_source(function))
        iw, w = np.empty(function.sz_iw() + 1, dtype=np.intc), np.empty(function.sz_w() + 1)
        multipliers = np.empty((2, rows + n))
        lib.kinqp_replay_qrqp(
            len(series.seconds), n, rows, _doubles(ffi, series.data), ffi.from_buffer("unsigned char[]", series.fresh),
            int(self.warm), _doubles(ffi, series.problem), ffi.new("const double *[]", function.sz_arg()),
            ffi.new("double *[]", function.sz_res()), ffi.from_buffer("int[]", iw), _doubles(ffi, w),
            _doubles(ffi, multipliers), _doubles(ffi, series.seconds), ffi.from_buffer("int[]", series.status),
            _doubles(ffi, series.answers),
        )  # fmt: skip


def c_replay(solver: Solver) -> CReplay | None:
    """Give a solver's C, fed with problems; None for solvers of which there is none."""
    if isinstance(solver, ActiveSet):
        return _ActiveSetReplay(solver)
    if isinstance(solver, CasadiQrqp):
        return _QrqpReplay(solver)
    return None


def _doubles(ffi: Any, array: Array) -> Any:
    return ffi.from_buffer("double[]", array)


def _read(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


@cache
def _active_set_library() -> tuple[Any, Any]:
    names = ("kinqp_clock.h", "replay_active_set.c")
    return _load("kinqp_replay_active_set", sources() | {name: _read(name) for name in names}, _ACTIVE_SET)


def _qrqp_source(function: Any) -> str:
    generator = ca.CodeGenerator("qrqp", {"with_header": False, "casadi_int": "int", "main": False})
    # The generated code carries its function's name.
    generator.add(function)
    return str(generator.dump()).replace("int qrqp(", "int kinqp_qrqp(")


@cache
def _qrqp_library(source: str) -> tuple[Any, Any]:
    names = ("kinqp_clock.h", "replay_qrqp.c")
    return _load("kinqp_replay_qrqp", {"qrqp.inc": source} | {name: _read(name) for name in names}, _QRQP)


def _load(name: str, texts: dict[str, str], header: str) -> tuple[Any, Any]:
    ffi = cffi.FFI()
    ffi.cdef(declarations(header))
    return ffi, ffi.dlopen(str(build_library(name, texts)))
