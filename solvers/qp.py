"""The quadratic program that every formulation produces and every solver accepts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from .validation import (
    Array,
    QPError,
    convex,
    order_bounds,
    require_finite,
    to_array,
    to_bound,
    to_matrix,
    to_vector,
)

if TYPE_CHECKING:
    import os

    import numpy.typing as npt

_FIELDS = ("H", "g", "A", "b", "C", "l", "u", "lb", "ub")


@dataclass(frozen=True, init=False, eq=False, repr=False)
class QP:
    """A convex quadratic program in the canonical form of this library.

    Minimise ``1/2 x'Hx + g'x`` subject to ``A x = b``, ``l <= C x <= u`` and ``lb <= x <= ub``, where an
    infinite bound means that this side is absent.

    Construct with keywords; everything but ``H`` and ``g`` may be left out. All arrays are copied, float64,
    C-contiguous and read-only; bounds that cross by rounding alone are set to their middle. The constraints are also
    there in one piece, equalities first and box last, as ``lower <= stacked @ x <= upper`` with
    ``stacked = [A; C; I]``; A, b, C, l, u, lb and ub are views of it.

    Parameters
    ----------
    H
        Hessian, symmetric positive semi-definite, shape (n, n). Of an array in single precision the rounding of that is
        allowed for, and negative eigenvalues within it are lifted to zero.
    g
        Linear cost, shape (n,).
    A, b
        Equalities, shapes (m_eq, n) and (m_eq,).
    C, l, u
        Two-sided rows, shapes (m_ineq, n), (m_ineq,) and (m_ineq,).
    lb, ub
        Box, shapes (n,).
    x_feasible
        A point known to satisfy all constraints, for example zero motion, shape (n,). Methods that must start
        from a feasible point start here; all others ignore it.

    Raises
    ------
    QPError
        When a shape, a value, the symmetry or convexity of H, or the order of two bounds is wrong.
    """

    H: Array
    g: Array
    A: Array
    b: Array
    C: Array
    l: Array
    u: Array
    lb: Array
    ub: Array
    stacked: Array
    lower: Array
    upper: Array
    x_feasible: Array | None

    def __init__(
        self,
        *,
        H: npt.ArrayLike,
        g: npt.ArrayLike,
        A: npt.ArrayLike | None = None,
        b: npt.ArrayLike | None = None,
        C: npt.ArrayLike | None = None,
        l: npt.ArrayLike | None = None,
        u: npt.ArrayLike | None = None,
        lb: npt.ArrayLike | None = None,
        ub: npt.ArrayLike | None = None,
        x_feasible: npt.ArrayLike | None = None,
    ) -> None:
        hessian = to_array("H", H)
        if hessian.ndim != 2 or hessian.shape[0] != hessian.shape[1] or hessian.size == 0:
            raise QPError(f"H must be square with at least one row, but has shape {hessian.shape}.")
        n = len(hessian)
        require_finite("H", hessian)
        hessian = convex(hessian, single=getattr(H, "dtype", None) in (np.float32, np.float16))
        cost = to_vector("g", g, n, "the number of variables")
        equal = to_matrix("A", A, n)
        rows = to_matrix("C", C, n)
        if A is None and b is not None:
            raise QPError("b was given without A, but each entry of b belongs to a row of A.")
        if len(equal) and b is None:
            raise QPError("A was given without b, but each row of A needs a right-hand side.")
        if C is None and (l is not None or u is not None):
            raise QPError("l or u was given without C, but their entries belong to rows of C (lb and ub to x).")
        right = to_vector("b", () if b is None else b, len(equal), "the number of rows of A")
        low = to_bound("l", l, len(rows), "the number of rows of C", -np.inf)
        high = to_bound("u", u, len(rows), "the number of rows of C", np.inf)
        box_low = to_bound("lb", lb, n, "the number of variables", -np.inf)
        box_high = to_bound("ub", ub, n, "the number of variables", np.inf)
        order_bounds("l", low, "u", high)
        order_bounds("lb", box_low, "ub", box_high)
        start = None if x_feasible is None else to_vector("x_feasible", x_feasible, n, "the number of variables")
        self._assemble(
            hessian,
            cost,
            np.concatenate((equal, rows, np.eye(n))),
            np.concatenate((right, low, box_low)),
            np.concatenate((right, high, box_high)),
            start,
            len(right),
        )

    @classmethod
    def trusted(
        cls,
        *,
        H: Array,
        g: Array,
        A: Array | None = None,
        b: Array | None = None,
        C: Array | None = None,
        l: Array | None = None,
        u: Array | None = None,
        lb: Array | None = None,
        ub: Array | None = None,
        x_feasible: Array | None = None,
    ) -> Self:
        """Assemble a QP without checking it, for control loops whose lowering guarantees what `QP` checks.

        Fields are those of `QP`. NaN passes through here and is caught, as `Status.INACCURATE`, when the
        solution is judged.
        """
        n = len(g)
        m_eq = 0 if A is None else len(A)
        box = m_eq + (0 if C is None else len(C))
        stacked = np.zeros((box + n, n))
        lower = np.full(box + n, -np.inf)
        upper = np.full(box + n, np.inf)
        # Entry (box + j, j) for every j: the identity of the box.
        stacked.reshape(-1)[box * n :: n + 1] = 1.0
        if A is not None:
            stacked[:m_eq] = A
        if b is not None:
            lower[:m_eq] = upper[:m_eq] = b
        if C is not None:
            stacked[m_eq:box] = C
        if l is not None:
            lower[m_eq:box] = l
        if u is not None:
            upper[m_eq:box] = u
        if lb is not None:
            lower[box:] = lb
        if ub is not None:
            upper[box:] = ub
        start = None if x_feasible is None else np.array(x_feasible, dtype=np.float64)
        self = cls.__new__(cls)
        self._assemble(
            np.array(H, dtype=np.float64, order="C"),
            np.array(g, dtype=np.float64),
            stacked,
            lower,
            upper,
            start,
            m_eq,
        )
        return self

    def _assemble(
        self, H: Array, g: Array, stacked: Array, lower: Array, upper: Array, start: Array | None, m_eq: int
    ) -> None:
        box = len(lower) - len(g)
        for array in (H, g, stacked, lower, upper):
            array.flags.writeable = False
        if start is not None:
            start.flags.writeable = False
        # A frozen instance is filled once, through its dictionary: much cheaper than object.__setattr__.
        self.__dict__.update(
            H=H,
            g=g,
            A=stacked[:m_eq],
            b=lower[:m_eq],
            C=stacked[m_eq:box],
            l=lower[m_eq:box],
            u=upper[m_eq:box],
            lb=lower[box:],
            ub=upper[box:],
            stacked=stacked,
            lower=lower,
            upper=upper,
            x_feasible=start,
        )

    @property
    def n(self) -> int:
        """Number of variables."""
        return len(self.g)

    @property
    def m_eq(self) -> int:
        """Number of equalities."""
        return len(self.b)

    @property
    def m_ineq(self) -> int:
        """Number of two-sided rows, the box not counted."""
        return len(self.C)

    @property
    def structure(self) -> tuple[int, int, int, bytes]:
        """What a solver's set-up depends on: sizes, which sides exist, and which two sides coincide."""
        lower, upper = self.lower, self.upper
        sides = np.isfinite(lower).tobytes() + np.isfinite(upper).tobytes() + (lower == upper).tobytes()
        return (len(self.g), len(self.b), len(self.C), sides)

    def objective(self, x: Array) -> float:
        """Value of ``1/2 x'Hx + g'x`` at `x`, shape (n,)."""
        return float(x @ (0.5 * (self.H @ x) + self.g))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all fields to `path` as NumPy's .npz, to be replayed with `load`."""
        arrays = {name: getattr(self, name) for name in _FIELDS}
        if self.x_feasible is not None:
            arrays["x_feasible"] = self.x_feasible
        # Through an open file, because np.savez would append .npz to a path that ends otherwise.
        with Path(path).open("wb") as file:
            np.savez(file, **arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, trusted: bool = False) -> Self:
        """Read what `save` wrote; `trusted` skips the checks, so that a defective QP can be replayed too.

        Raises
        ------
        QPError
            When a field is missing or, unless trusted, when the data are not a valid QP.
        """
        with np.load(path, allow_pickle=False) as file:
            missing = [name for name in _FIELDS if name not in file]
            if missing:
                raise QPError(f"{path} must hold the fields {', '.join(_FIELDS)}, but {', '.join(missing)} is missing.")
            arrays = {name: file[name] for name in (*_FIELDS, "x_feasible") if name in file}
        return cls.trusted(**arrays) if trusted else cls(**arrays)

    def __repr__(self) -> str:
        return f"QP(n={self.n}, m_eq={self.m_eq}, m_ineq={self.m_ineq})"
