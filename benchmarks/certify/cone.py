"""Whether linear conditions can hold together: floating point proposes a proof, integers check it.

Conditions are homogeneous, a'theta > 0 or a'theta >= 0. By Motzkin's transposition theorem either a theta satisfies all
of them, or some of the a, with positive weights and a strict one among them, add up to zero. Either is checked exactly.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from fractions import Fraction
from math import lcm
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import nnls

from .exact import combined, direction, dot, integers, null_vector, reduced

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .exact import Form

    Array = NDArray[np.float64]

#: Distance from where conditions end, at |theta| = 1, below which rounding may decide [-].
NEAR: Final = 1e-9
# Distance of the origin from the convex hull of the unit a below which a proof of emptiness is tried first.
_THIN: Final = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Condition:
    """form'theta > 0, or >= 0 where not strict; `unit` is the form at length 1, in floating point."""

    form: Form
    strict: bool
    unit: Array

    @classmethod
    def of(cls, form: Form, *, strict: bool) -> Condition:
        """Shorten a form and note its direction."""
        short = reduced(form)
        return cls(short, strict, direction(short))

    @classmethod
    def exactly(cls, values: Array, *, strict: bool) -> Condition:
        """Take a form from doubles, to the last bit."""
        return cls.of(rounded(values), strict=strict)

    def holds(self, theta: Form) -> bool:
        """Whether a theta satisfies it, exactly."""
        value = dot(self.form, theta)
        return value > 0 or (value == 0 and not self.strict)


@dataclass
class Tally:
    """How conditions were decided.

    Attributes
    ----------
    witnessed : int
        By a theta that floating point proposed.
    refuted : int
        By weights whose support floating point proposed.
    simplex : int
        By the simplex method in fractions: what is thinner than floating point can see.
    again : int
        By a refutation of the same conditions, found before.
    """

    witnessed: int = 0
    refuted: int = 0
    again: int = 0
    simplex: int = 0

    def __add__(self, other: Tally) -> Tally:
        """Sum of both."""
        return Tally(*(mine + its for mine, its in zip(astuple(self), astuple(other), strict=True)))


class Decider:
    """Decides whether conditions can hold together; every answer is proved in integers.

    Attributes
    ----------
    tally : Tally
    """

    def __init__(self) -> None:
        self.tally = Tally()
        self._conflicts: dict[Condition, list[frozenset[Condition]]] = {}

    def witness(self, known: Sequence[Condition], new: Sequence[Condition]) -> Form | None:
        """Give a theta that satisfies all conditions, in integers, or None: then there is none.

        Where they have an inside, it is the theta that is, relative to its length, farthest within all of them.

        Parameters
        ----------
        known : sequence of Condition
            That can hold together.
        new : sequence of Condition
            Those that join them.
        """
        conditions = (*known, *new)
        if self._conflict(conditions, new):
            self.tally.again += 1
            return None
        weights, distance, theta = _nearest(np.array([condition.unit for condition in conditions]))
        if distance > _THIN:
            whole = rounded(theta)
            if all(condition.holds(whole) for condition in conditions):
                self.tally.witnessed += 1
                return whole
        support = [condition for condition, weight in zip(conditions, weights, strict=True) if weight > 0.0]
        if _refutes(support):
            self.tally.refuted += 1
            self._learn(support)
            return None
        self.tally.simplex += 1
        exact, support = _simplex(conditions)
        if exact is None:
            self._learn(support)
        return exact

    def _conflict(self, conditions: Sequence[Condition], new: Sequence[Condition]) -> bool:
        every = set(conditions)
        return any(conflict <= every for condition in new for conflict in self._conflicts.get(condition, ()))

    def _learn(self, support: Sequence[Condition]) -> None:
        conflict = frozenset(support)
        for condition in conflict:
            self._conflicts.setdefault(condition, []).append(conflict)


def margin(conditions: Sequence[Condition], theta: Array) -> float:
    """Least distance of theta / |theta| from the planes where conditions end; negative outside [-]."""
    units = np.array([condition.unit for condition in conditions])
    return float((units @ theta).min() / np.linalg.norm(theta))


def rounded(theta: Array) -> Form:
    """Give the same direction in integers, to the last bit."""
    whole, _ = integers(theta)
    return tuple(whole.tolist())


def _nearest(units: Array) -> tuple[Array, float, Array]:
    """Point of the convex hull of unit forms that is nearest to the origin: its weights, its length, it itself.

    All forms are as large as its length along its direction, so that it satisfies all conditions unless it is zero.
    """
    count, size = units.shape
    system = np.vstack([units.T, np.ones(count)])
    weights, _ = nnls(system, np.append(np.zeros(size), 1.0), maxiter=50 * count + 200)
    total = float(weights.sum())
    point = weights @ units / total
    return weights, float(np.linalg.norm(point)), point


def _refutes(conditions: Sequence[Condition]) -> bool:
    """Whether one combination of conditions, with positive weights and a strict one among them, is zero."""
    weights = null_vector([condition.form for condition in conditions]) if conditions else None
    if weights is None:
        return False
    if min(weights) < 0:
        weights = tuple(-weight for weight in weights)
    strict = any(condition.strict and weight for condition, weight in zip(conditions, weights, strict=True))
    return min(weights) >= 0 and strict and not any(combined(weights, [condition.form for condition in conditions]))


def _simplex(conditions: Sequence[Condition]) -> tuple[Form | None, list[Condition]]:
    """A theta, or None and the conditions that refute: the simplex method's first phase in fractions, by Bland's rule.

    Weights y >= 0 with sum y a = 0 and 1 in all on strict conditions refute; without such, the prices are a theta.
    """
    size = len(conditions[0].form)
    columns = [[Fraction(entry) for entry in (*c.form, int(c.strict))] for c in conditions]
    rows, count = size + 1, len(columns)
    basis = [count + i for i in range(rows)]  # one artificial weight for each equation
    inverse = [[Fraction(int(i == j)) for j in range(rows)] for i in range(rows)]
    values = [Fraction(int(i == size)) for i in range(rows)]
    while True:
        prices = [sum((inverse[i][j] for i in range(rows) if basis[i] >= count), Fraction(0)) for j in range(rows)]
        entering = next(
            (
                k
                for k in range(count)
                if k not in basis and sum(p * x for p, x in zip(prices, columns[k], strict=True)) > 0
            ),
            None,
        )
        if entering is None:
            break
        change = [sum((x * y for x, y in zip(row, columns[entering], strict=True)), Fraction(0)) for row in inverse]
        _, _, leaving = min((values[i] / change[i], basis[i], i) for i in range(rows) if change[i] > 0)
        pivot = change[leaving]
        inverse[leaving] = [x / pivot for x in inverse[leaving]]
        values[leaving] /= pivot
        for i in range(rows):
            if i != leaving and change[i]:
                inverse[i] = [x - change[i] * y for x, y in zip(inverse[i], inverse[leaving], strict=True)]
                values[i] -= change[i] * values[leaving]
        basis[leaving] = entering
    if not any(values[i] for i in range(rows) if basis[i] >= count):
        return None, [conditions[k] for i, k in enumerate(basis) if k < count and values[i]]
    theta = [-price for price in prices[:size]]
    common = lcm(*(x.denominator for x in theta))
    whole = reduced(int(x * common) for x in theta)
    if not all(condition.holds(whole) for condition in conditions):
        raise AssertionError("the prices of an optimal basis satisfy all conditions")
    return whole, []
