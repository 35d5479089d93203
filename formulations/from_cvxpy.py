"""A problem written in cvxpy as a formulation like any other."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Final, final

import casadi as ca
import numpy as np

from .base import Formulation
from .canonical import Canonical, canonicalise, unique
from .program import DeclarationError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .canonical import Block, Given
    from .program import QuadraticProgram
    from .tick import Tick

# Directions of a constant quadratic form whose curvature is less than this (relative) are rounding.
_FLAT: Final = 1e-14
_NAME: Final = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")


def from_cvxpy(problem: object, command: object, name: str, feasible: Mapping[str, object], bounds: str) -> Formulation:
    """Make the formulation; see `Formulation.from_cvxpy`."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise DeclarationError(f"name: expected kebab-case as in 'joint-space', got {name!r}")
    canonical, given_name = canonicalise(problem, command, name, feasible), name

    @final
    @dataclass(frozen=True)
    class FromCvxpy(Formulation):
        """Written in cvxpy; see `Formulation.from_cvxpy`."""

        name: ClassVar[str] = given_name

        def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
            """State the problem of one control cycle."""
            _Declaration(canonical, self.name, qp, tick).declare()

    return FromCvxpy(bounds)


class _Declaration:
    """The canonical problem put into the symbols of a tick."""

    def __init__(self, canonical: Canonical, name: str, qp: QuadraticProgram, tick: Tick) -> None:
        self.canonical: Final = canonical
        self.name: Final = name
        self.qp: Final = qp
        self.tick: Final = tick
        size = canonical.A.shape[1]
        theta = ca.SX.ones(size, 1)
        for given in canonical.parameters:
            symbols = self._symbols(given)
            for k, entry in enumerate(given.entries):
                theta[given.start + k] = symbols[int(entry)]
        self.theta: Final = theta
        n, m = canonical.n, canonical.m
        self.P: Final = self._matrix(canonical.P, n, n)
        self.q: Final = self._matrix(canonical.q, n + 1, 1)
        rows = self._matrix(canonical.A, m, n + 1)
        self.A: Final = ca.sparsify(rows[:, :n])
        self.b: Final = rows[:, n]

    def declare(self) -> None:
        """Variables, objective, rows, command."""
        canonical, qp = self.canonical, self.qp
        definitions = self._definitions()
        x = ca.SX(canonical.n, 1)
        for unknown in canonical.unknowns:
            columns = range(unknown.columns.start, unknown.columns.stop)
            if not all(j in definitions for j in columns):
                x[unknown.columns] = qp.variable(unknown.name, len(columns))
                definitions = {j: i for j, i in definitions.items() if j not in columns}
        # What a row defines appears in no other row, so the rows of others are free of it.
        for j, i in definitions.items():
            others = [k for k in self.A[i, :].sparsity().get_col() if k not in definitions]
            rest = ca.mtimes(self.A[i, others], x[others]) + self.b[i] if others else self.b[i]
            x[j] = -rest / float(self.A[i, j])
        self._objective(x)
        self._rows(x, set(definitions.values()))
        qp.command(x[canonical.command.columns])
        qp.feasible(**{name: x[unknown.columns] for name, unknown in canonical.feasible.items()})

    def _matrix(self, tensor: Any, rows: int, columns: int) -> ca.SX:
        return ca.reshape(ca.sparsify(ca.mtimes(_to_casadi(tensor), self.theta)), rows, columns)

    def _symbols(self, given: Given) -> ca.SX:
        """Entries of a parameter, column by column: a quantity of the tick, or else a run-time input."""
        label = f"{self.name}, parameter {given.name}"
        size = int(np.prod(given.shape, dtype=int))
        if not hasattr(type(self.tick), given.name):
            if given.signed:
                raise DeclarationError(f"{label}: expected no sign or nonneg=True, got nonpos; write it with a minus")
            default = None if given.value is None else given.value.flatten(order="F")
            return self.tick.parameter(given.name, default, size=size, lowest=0.0 if given.nonneg else -np.inf)
        quantity = getattr(self.tick, given.name)
        if not isinstance(quantity, ca.SX):
            raise DeclarationError(f"{label}: expected another name, a tick has something else of this one")
        rows, columns = quantity.shape
        shapes = {(rows, columns)} | ({(rows,)} if columns == 1 else set()) | ({()} if rows == columns == 1 else set())
        if given.shape not in shapes:
            wanted = (rows,) if columns == 1 else (rows, columns)
            raise DeclarationError(
                f"{label}: expected shape {wanted} for {self.tick.robot.name} in mode {self.tick.mode},"
                f" got {given.shape}"
            )
        return ca.vec(ca.densify(quantity))

    def _definitions(self) -> dict[int, int]:
        """Find auxiliary variables that a row defines: unbounded, in no other row, with a constant in front.

        cvxpy makes one for every sum of squares. Put in, the residual takes its place, so that H is as definite as the
        problem was written.
        """
        canonical = self.canonical
        equalities = {
            i for block in canonical.blocks if block.equality for i in range(block.rows.start, block.rows.stop)
        }
        coupled = ca.sparsify(self.P - ca.diag(ca.diag(self.P)))
        in_products = {j for j in range(canonical.n) if coupled[:, j].nnz()}
        auxiliary = (unknown for unknown in canonical.unknowns if not unknown.own)
        found: dict[int, int] = {}
        for unknown in (*auxiliary, canonical.command, *canonical.feasible.values()):
            for j in range(unknown.columns.start, unknown.columns.stop):
                rows = self.A[:, j].sparsity().row()
                alone = len(rows) == 1 and rows[0] in equalities and j not in in_products
                free = alone and rows[0] not in found.values()
                if free and self.A[rows[0], j].is_constant():
                    found[j] = rows[0]
        return found

    def _objective(self, x: ca.SX) -> None:
        weights = ca.diag(self.P)
        squares = ca.sparsify(self.P - ca.diag(weights))
        coupled = [j for j in range(self.canonical.n) if squares[:, j].nnz()]
        for unknown in self.canonical.unknowns:
            columns = [
                j
                for j in range(unknown.columns.start, unknown.columns.stop)
                if not weights[j].is_zero() and j not in coupled
            ]
            if columns:
                self.qp.minimize(
                    x[columns], weight=ca.densify(weights[columns]), name=f"square {len(self.qp.terms) + 1}"
                )
        if coupled:
            self._forms(x, coupled)
        cost = ca.mtimes(self.q[: self.canonical.n].T, x)
        if not cost.is_zero():
            self.qp.minimize_linear(cost, name="linear cost")

    def _forms(self, x: ca.SX, coupled: list[int]) -> None:
        """Take quadratic forms apart: P is a sum of parameters, none negative by DCP, times convex ones."""
        n, tensor = self.canonical.n, self.canonical.P
        for k in range(tensor.shape[1]):
            matrix = tensor[:, [k]].toarray().reshape(n, n, order="F")[np.ix_(coupled, coupled)]
            if not matrix.any():
                continue
            values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
            kept = values > _FLAT * values[-1]
            factor = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
            self.qp.minimize(
                ca.mtimes(ca.DM(factor), x[coupled]), weight=self.theta[k], name=f"form {len(self.qp.terms) + 1}"
            )

    def _rows(self, x: ca.SX, used: set[int]) -> None:
        names: set[str] = set()
        blocks = list(self.canonical.blocks)
        while blocks:
            block = blocks.pop(0)
            rows = [i for i in range(block.rows.start, block.rows.stop) if i not in used]
            if not rows:
                continue
            expression, offset = ca.mtimes(self.A[rows, :], x), self.b[rows]
            if block.equality:
                self.qp.equal(expression, -offset, name=unique(block.name, names))
                continue
            # lo <= x and x <= hi come as two; together they are rows with two sides.
            twin = next((other for other in blocks if self._opposite(block, other)), None)
            lower, upper = -offset, ca.SX.ones(len(rows), 1) * np.inf
            name = block.name
            if twin is not None:
                blocks.remove(twin)
                upper = self.b[twin.rows]
                name = name if twin.name == name else f"{name} / {twin.name}"
            if self._falling(block):
                expression, lower, upper = -expression, -upper, -lower
            self.qp.between(lower, expression, upper, name=unique(name, names))

    def _slopes(self, block: Block) -> Any:
        """Rows of the map to A that belong to a block, in the order of its rows."""
        m, n = self.canonical.m, self.canonical.n
        rows = np.arange(block.rows.start, block.rows.stop)
        places = (np.arange(n)[:, None] * m + rows[None, :]).reshape(-1)
        return self.canonical.A[places, :]

    def _opposite(self, one: Block, other: Block) -> bool:
        if other.equality or one.rows.stop - one.rows.start != other.rows.stop - other.rows.start:
            return False
        return not np.any((self._slopes(one) + self._slopes(other)).data)

    def _falling(self, block: Block) -> bool:
        """Whether rows say -x >= -hi: turned round they are bounds that are called what they are."""
        return float(self._slopes(block)[:, [-1]].sum()) < 0.0


def _to_casadi(matrix: Any) -> ca.DM:
    """Turn a scipy array in CSC form into CasADi's."""
    matrix = matrix.copy()
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    rows, columns = matrix.shape
    sparsity = ca.Sparsity(int(rows), int(columns), matrix.indptr.tolist(), matrix.indices.tolist())
    return ca.DM(sparsity, matrix.data)
