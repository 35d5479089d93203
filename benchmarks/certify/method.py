"""The active set's decisions on least-distance problems whose data are linear in theta, as conditions on theta.

minimise 1/2 |w|^2 subject to qd_lo <= M (v + w) <= qd_hi, by the dual method of Goldfarb and Idnani as the C code of
`kinqp.solvers.active_set` has it: rule of entering, rule of dropping, and which of two equals is taken. Where it stands
follows from the active sides and the one that enters alone, whatever the way there; so does every comparison.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Final

import numpy as np

from .cone import Condition
from .exact import adjugate, combined, dot, integers, reciprocal_lengths

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .exact import Form, Matrix

    Array = NDArray[np.float64]
    #: A row and its side: -1 lower, +1 upper.
    Side = tuple[int, int]
    Sides = tuple[Side, ...]

# As in the C code: a row is dependent if less than this share of it, squared, is outside the active normals; and a
# multiplier that moves by less than this share, squared, of the entering one blocks nothing.
_DEPENDENT: Final = (10**10) ** 2
_UNMOVED: Final = 10**26


class DependentRowsError(ValueError):
    """Rows of M are so nearly dependent that the code calls them dependent, and they are not: rounding decides."""


@dataclass(frozen=True)
class Decision:
    """What happens next, and when.

    Attributes
    ----------
    active : tuple of (int, int)
        Active sides after it, oldest first.
    entering : (int, int) or None
        The side that is on its way in after it; None: none is.
    steps : int
        Iterations that it takes.
    conditions : tuple of Condition
        Under which it is taken.
    """

    active: Sides
    entering: Side | None
    steps: int
    conditions: tuple[Condition, ...]


@dataclass(frozen=True)
class _Face:
    """Active sides: N'N's adjugate and determinant, and the sides' bounds in theta."""

    adjugate: Matrix
    determinant: int
    normals: list[Form]
    bounds: list[Form]
    multipliers: list[Form]


class DualMethod:
    """The method on one M.

    Parameters
    ----------
    M : ndarray, shape (nv, m_free)
        J#; rows of zeros never take part.
    low, high : ndarray, shape (nv, k)
        qd_lo = low s and qd_hi = high s, for k numbers s; theta = (v, s).
    widening : ndarray, shape (m_free + k,), optional
        By which both are wider, times theta; nothing unless told otherwise.
    """

    def __init__(self, M: Array, low: Array, high: Array, widening: Array | None = None) -> None:
        self.nv, self.m_free = M.shape
        size = self.m_free + low.shape[1]
        wider = np.zeros(size) if widening is None else widening
        whole, _ = integers(np.concatenate([M.ravel(), low.ravel(), high.ravel(), wider]))
        ends = np.cumsum([M.size, low.size, high.size])
        matrix, below, above, form = np.split(whole, ends)
        self._M, self._low, self._high = (part.reshape(self.nv, -1).tolist() for part in (matrix, below, above))
        self._widening: list[int] = form.tolist()
        self._squares = [dot(row, row) for row in self._M]
        self._per_length = reciprocal_lengths(self._squares)
        self._sides: list[Side] = [(i, sign) for i in range(self.nv) if self._squares[i] for sign in (-1, 1)]
        self._faces: dict[Sides, _Face] = {}
        self._known: dict[tuple[Form, bool], Condition] = {}
        self._next: dict[tuple[Sides, Side | None], tuple[Decision, ...]] = {}

    def decisions(self, active: Sides, entering: Side | None) -> tuple[Decision, ...]:
        """Give all that can happen next; their conditions exclude each other, and one of them is met.

        Nothing entering: which side does, at 0 steps; or none, at the end, which is told by the same `active`.
        """
        key = (active, entering)
        if key not in self._next:
            found = self._choices(active) if entering is None else self._steps(active, entering)
            # 0 >= 0 is no condition, and 0 > 0 never met.
            never = [any(c.strict and not any(c.form) for c in each.conditions) for each in found]
            self._next[key] = tuple(
                replace(each, conditions=tuple(c for c in each.conditions if any(c.form)))
                for each, out in zip(found, never, strict=True)
                if not out
            )
        return self._next[key]

    def distance(self, active: Sides, side: Side, theta: Form) -> float:
        """How far the point on active sides is outside another one, as a share of |v|; 0 for a hand at rest [-]."""
        face, v = self._face(active), theta[: self.m_free]
        speed = dot(v, v)
        if not speed:
            return 0.0
        outside = dot(self._outside(face, side), theta)
        squared = Fraction(outside * outside, face.determinant**2 * self._squares[side[0]] * speed)
        return math.copysign(math.sqrt(squared), outside)

    def _condition(self, form: Form, *, strict: bool) -> Condition:
        """One object for one condition, so that what was once proved of it is found again."""
        made = Condition.of(form, strict=strict)
        return self._known.setdefault((made.form, strict), made)

    def _normal(self, side: Side) -> Form:
        """P of the side's constraint p'w >= bound."""
        return tuple(-side[1] * entry for entry in self._M[side[0]])

    def _bound(self, side: Side) -> Form:
        """Bound of p'w >= bound, in theta."""
        row, sign = side
        limits = self._low if sign < 0 else self._high
        narrow = (*(sign * entry for entry in self._M[row]), *(-sign * entry for entry in limits[row]))
        return tuple(entry - wider for entry, wider in zip(narrow, self._widening, strict=True))

    def _face(self, active: Sides) -> _Face:
        if active not in self._faces:
            normals, bounds = [self._normal(side) for side in active], [self._bound(side) for side in active]
            inverse, determinant = adjugate([[dot(p, q) for q in normals] for p in normals])
            multipliers = [combined(row, bounds) for row in inverse]
            self._faces[active] = _Face(inverse, determinant, normals, bounds, multipliers)
        return self._faces[active]

    def _outside(self, face: _Face, side: Side) -> Form:
        """How far the face's point is outside a side, times the face's determinant."""
        along = [dot(self._normal(side), normal) for normal in face.normals]
        return combined([face.determinant, *(-each for each in along)], [self._bound(side), *face.multipliers])

    def _choices(self, active: Sides) -> list[Decision]:
        """The side farthest outside enters, the first of equals; or all hold."""
        face, within = self._face(active), {row for row, _ in active}
        sides = [side for side in self._sides if side[0] not in within]
        far = {side: self._outside(face, side) for side in sides}
        inside = tuple(self._condition(tuple(-x for x in far[side]), strict=False) for side in sides)
        found = [Decision(active, None, 0, inside)]
        for side in sides:
            conditions = [self._condition(far[side], strict=True)]
            for other in sides:
                if other[0] != side[0]:  # of a row's two sides only one can be outside
                    per, other_per = self._lengths(side[0], other[0])
                    apart = tuple(per * x - other_per * y for x, y in zip(far[side], far[other], strict=True))
                    conditions.append(self._condition(apart, strict=other[0] < side[0]))
            found.append(Decision(active, side, 0, tuple(conditions)))
        return found

    def _lengths(self, row: int, other: int) -> tuple[int, int]:
        """Reciprocals of two rows' lengths, up to a common factor; exact where their ratio is rational."""
        product = self._squares[row] * self._squares[other]
        root = math.isqrt(product)
        if root * root == product:
            return root, self._squares[row]
        return self._per_length[row], self._per_length[other]

    def _steps(self, active: Sides, entering: Side) -> list[Decision]:
        """The first of the sides that block is dropped, or the one that enters is in.

        All are compared by the entering side's own multiplier x at which they happen: that of an active side is
        (U - T x) / det, so x is a form in theta divided by a positive number.
        """
        face, p = self._face(active), self._normal(entering)
        square = self._squares[entering[0]]
        along = [dot(p, normal) for normal in face.normals]
        rates = [dot(row, along) for row in face.adjugate]  # T
        left = face.determinant * square - dot(along, rates)  # det |e|^2
        dependent = len(active) == self.m_free or left * _DEPENDENT <= square * face.determinant
        events: dict[int, tuple[Form, int]] = {}
        by_rounding = dependent and left != 0
        for j, rate in enumerate(rates):
            if rate > 0:
                events[j] = face.multipliers[j], rate
                by_rounding |= rate * rate * self._squares[active[j][0]] * _UNMOVED <= square * face.determinant**2
        if by_rounding:
            rows = sorted(row for row, _ in (*active, entering))
            raise DependentRowsError(f"rows {rows} of M: some depend on others to rounding, but not exactly")
        if not dependent:
            events[-1] = self._outside(face, entering), left
        found = []
        for which, (form, per) in events.items():
            conditions = []
            for other, (other_form, other_per) in events.items():
                if other == which:
                    continue
                sooner = tuple(per * y - other_per * x for x, y in zip(form, other_form, strict=True))
                # Being in comes before dropping where they coincide; of two to drop the older one goes.
                strict = other < 0 or (which >= 0 and other < which)
                conditions.append(self._condition(sooner, strict=strict))
            if which < 0:
                found.append(Decision((*active, entering), None, 1, tuple(conditions)))
            else:
                rest = (*active[:which], *active[which + 1 :])
                found.append(Decision(rest, entering, 1, tuple(conditions)))
        return found
