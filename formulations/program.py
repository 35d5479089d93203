"""The declaration of a QP: variables, weighted residuals, named rows, the command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import casadi as ca
import numpy as np

Operand = ca.SX | float | np.ndarray


class DeclarationError(ValueError):
    """A formulation was declared in a way that is not a convex QP; the message names the term or the rows."""


@dataclass(frozen=True)
class Term:
    """One objective term, 1/2 residual' W residual."""

    name: str
    residual: ca.SX
    weight: ca.SX


@dataclass(frozen=True)
class Cost:
    """One linear objective term, a scalar affine in the variables."""

    name: str
    expression: ca.SX


@dataclass(frozen=True)
class Rows:
    """Named rows lower <= expression <= upper; equalities have `upper` is None and mean expression = lower."""

    name: str
    expression: ca.SX
    lower: ca.SX
    upper: ca.SX | None


class QuadraticProgram:
    """Collects what a formulation declares; `lower` turns it into the canonical QP.

    Objective terms are weighted residuals affine in the variables, so that every declared problem is convex and
    DPP-compliant in cvxpy. Rows carry names, which survive into reports of active sets.
    """

    def __init__(self) -> None:
        self.variables: Final[dict[str, ca.SX]] = {}
        self.terms: Final[list[Term]] = []
        self.costs: Final[list[Cost]] = []
        self.rows: Final[list[Rows]] = []
        self.command_expression: ca.SX | None = None
        self.feasible_values: Final[dict[str, ca.SX]] = {}

    def variable(self, name: str, size: int) -> ca.SX:
        """Declare `size` unknowns under a name.

        Returns
        -------
        ca.SX, shape (size, 1)
        """
        if name in self.variables:
            raise DeclarationError(f"variable {name}: expected a new name, it is declared already")
        if size < 1:
            raise DeclarationError(f"variable {name}: expected a size of at least 1, got {size}")
        self.variables[name] = ca.SX.sym(name, size)
        return self.variables[name]

    def minimize(self, residual: Operand, weight: Operand = 1.0, name: str | None = None) -> None:
        """Add 1/2 r' W r to the objective.

        Parameters
        ----------
        residual : ca.SX, shape (k, 1)
            Affine in the variables.
        weight : float or ca.SX, shape () or (k, 1)
            W's diagonal; not negative.
        name : str, optional
            For messages; "term 1", "term 2", ... unless given.
        """
        label = name or f"term {len(self.terms) + 1}"
        r = ca.SX(residual)
        w = ca.SX(weight)
        if r.size2() != 1:
            raise DeclarationError(f"{label}: expected a column as residual, got shape {r.shape}")
        if w.shape not in ((1, 1), r.shape):
            raise DeclarationError(f"{label}: expected one weight or {r.size1()}, got shape {w.shape}")
        if w.is_constant() and not np.all(np.asarray(ca.DM(w)) >= 0.0):
            raise DeclarationError(f"{label}: expected weights that are not negative, got {w}")
        self.terms.append(Term(label, r, ca.repmat(w, r.size1(), 1) if w.shape == (1, 1) else w))

    def minimize_linear(self, cost: Operand, name: str | None = None) -> None:
        """Add a scalar to the objective that is affine in the variables, such as the bound of a largest entry.

        Parameters
        ----------
        cost : ca.SX, scalar
        name : str, optional
            For messages; "cost 1", "cost 2", ... unless given.
        """
        label, expression = name or f"cost {len(self.costs) + 1}", ca.SX(cost)
        if expression.shape != (1, 1):
            raise DeclarationError(f"{label}: expected a scalar as linear cost, got shape {expression.shape}")
        self.costs.append(Cost(label, expression))

    def equal(self, left: Operand, right: Operand, name: str) -> None:
        """Add equality rows left = right, affine in the variables; no rows at all are accepted and left out."""
        self._add(name, ca.SX(left), ca.SX(right), None)

    def between(self, lower: Operand, expression: Operand, upper: Operand, name: str) -> None:
        """Add rows lower <= expression <= upper; the expression affine in the variables, the sides free of them."""
        self._add(name, ca.SX(expression), ca.SX(lower), ca.SX(upper))

    def command(self, expression: Operand) -> None:
        """Say what the robot is sent: an expression affine in the variables, shape (nv, 1) [rad/s or m/s]."""
        if self.command_expression is not None:
            raise DeclarationError("command: expected one command, it is declared already")
        self.command_expression = ca.SX(expression)

    def feasible(self, **values: Operand) -> None:
        """Name a point that satisfies all rows whatever the state, for solvers that need a feasible start.

        Parameters
        ----------
        **values : float or ca.SX
            Value of every variable, by name.
        """
        for name, value in values.items():
            if name not in self.variables:
                known = ", ".join(self.variables)
                raise DeclarationError(f"feasible point: expected variables among {known}, got {name}")
            point, shape = ca.SX(value), self.variables[name].shape
            if point.shape not in ((1, 1), shape):
                raise DeclarationError(f"feasible point: expected {name} of shape {shape}, got {point.shape}")
            self.feasible_values[name] = point + ca.SX(*shape)

    def _add(self, name: str, expression: ca.SX, lower: ca.SX, upper: ca.SX | None) -> None:
        size = expression.size1()
        if any(rows.name == name for rows in self.rows):
            raise DeclarationError(f"{name}: expected a new name, these rows are declared already")
        for side in (lower, upper):
            if side is not None and side.shape not in ((1, 1), expression.shape):
                raise DeclarationError(f"{name}: expected sides of shape {expression.shape}, got {side.shape}")
        if expression.size2() != 1 and size:
            raise DeclarationError(f"{name}: expected a column, got shape {expression.shape}")
        if size:
            column = ca.SX.ones(size, 1)
            self.rows.append(Rows(name, expression, lower * column, None if upper is None else upper * column))
