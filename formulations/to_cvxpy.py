"""A declaration as a parametrised cvxpy problem: an independent second opinion, and the way to cvxpygen."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

import casadi as ca
import cvxpy
import numpy as np
from cvxpy.atoms.affine.binary_operators import multiply
from cvxpy.atoms.sum_squares import sum_squares

from .blocks import constant, is_diagonal, multiple_of_identity, split, split_rows
from .inputs import complete_inputs
from .lowering import lower

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..robots import Robot
    from .base import Formulation
    from .blocks import Affine
    from .lowering import Lowered
    from .modes import Mode
    from .program import Rows

    Array = NDArray[np.float64]

#: What an infinite side becomes where only the inputs make it so; solvers take this much for "absent".
INFINITE: Final = 1e20
# cvxpy's word, and the one that cvxpygen's solvers leave behind.
_SOLVED: Final = (cvxpy.OPTIMAL, "solved")


class NotSolvedError(RuntimeError):
    """A command was asked for before the problem was solved; the message gives the problem's status."""


class CvxpyProblem:
    """A formulation on a robot in a mode as a cvxpy problem; `Formulation.to_cvxpy` makes one.

    Every objective term is ``0.5 * sum_squares(R @ x - r)``, its weight within R and r; every declared row keeps its
    name as the label of its constraints. What changes from tick to tick is a Parameter, and no two Parameters are ever
    multiplied: the problem follows the rules of disciplined parametrised programming (DPP), so that cvxpy compiles
    it once. Not to be shared between threads.

    Attributes
    ----------
    problem : cvxpy.Problem
    variables : dict of str to cvxpy.Variable
        By their declared names.
    parameters : dict of str to cvxpy.Parameter
        By name: the term or rows, and the variable that it multiplies, or `target`, `equals`, `lower`, `upper`.
    constraints : dict of str to list of cvxpy.Constraint
        Of each named rows: one if they are equalities, else that of the lower and that of the upper sides, where there
        are finite ones.
    lowered : Lowered
        The same declaration as numbers.
    """

    def __init__(self, formulation: Formulation, robot: Robot, mode: Mode) -> None:
        self.lowered: Final[Lowered] = lower(formulation, robot, mode)
        program = self.lowered.program
        self.variables: Final = {
            name: cvxpy.Variable(symbol.size1(), name=_identifier(name)) for name, symbol in program.variables.items()
        }
        self.parameters: Final[dict[str, cvxpy.Parameter]] = {}
        self.constraints: Final[dict[str, list[Any]]] = {}
        self._values: Final[dict[str, ca.SX]] = {}
        objective: Any = 0.0
        for term in program.terms:
            scaled = ca.sqrt(term.weight)
            parts = split(term.residual, program.variables)
            slopes = {name: ca.repmat(scaled, 1, slope.size2()) * slope for name, slope in parts.slopes.items()}
            residual = self._sum(term.name, slopes)
            if residual is not None:
                objective += 0.5 * sum_squares(residual - self._column(f"{term.name} target", -scaled * parts.offset))
        for cost in program.costs:
            slopes = split(cost.expression, program.variables).slopes
            objective += sum(
                self._column(f"{cost.name} {name}", s.T) @ self.variables[name] for name, s in slopes.items()
            )
        for rows in program.rows:
            self.constraints[rows.name] = self._rows(rows, split_rows(rows, program.variables))
        flat = [constraint for made in self.constraints.values() for constraint in made]
        self.problem: Final = cvxpy.Problem(cvxpy.Minimize(objective), flat)
        outputs = [ca.densify(value) for value in self._values.values()]
        symbols = [given.symbol for given in self.lowered.inputs]
        self._evaluate: Final = ca.Function("parameters", symbols, [*outputs, *self._command_map(symbols)])
        self._command: tuple[Array, Array] | None = None

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the run-time inputs that `set` takes."""
        return tuple(given.name for given in self.lowered.inputs)

    def set(self, **inputs: ArrayLike) -> None:
        """Set all Parameters to their values at a state.

        Parameters
        ----------
        **inputs : array_like
            `q` and `v` always, `qd_prev` and others without a default where the formulation has them, and any other of
            `inputs`.

        Raises
        ------
        InputError
            Naming an input that is unknown, missing, of the wrong size, not finite or out of its range.
        """
        values = complete_inputs(self.lowered.inputs, inputs, self.lowered.mode)
        results = self._evaluate.call([ca.DM(value) for value in values.values()])
        *numbers, K, k = (np.array(result, dtype=float) for result in results)
        for name, value in zip(self._values, numbers, strict=True):
            parameter = self.parameters[name]
            parameter.value = np.clip(value, -INFINITE, INFINITE).reshape(parameter.shape)
        self._command = K, k[:, 0]

    def command(self) -> Array:
        """Give the command of the solved problem, shape (nv,) [rad/s or m/s].

        Raises
        ------
        NotSolvedError
            When `set` was not called, or the problem's status is not optimal.
        """
        if self._command is None or str(self.problem.status).lower() not in _SOLVED:
            raise NotSolvedError(f"command: expected set() and a solved problem, got status {self.problem.status}")
        K, k = self._command
        return np.asarray(K @ np.concatenate([variable.value for variable in self.variables.values()]) + k)

    def _command_map(self, symbols: list[ca.SX]) -> tuple[ca.SX, ca.SX]:
        data = dict(zip(self.lowered.function.name_out(), self.lowered.function(*symbols), strict=True))
        return data["K"], data["k"]

    def _rows(self, rows: Rows, parts: Affine) -> list[Any]:
        expression = self._sum(rows.name, parts.slopes)
        if expression is None:  # rows of numbers and inputs alone: feasible or not, but still rows
            expression = cvxpy.Constant(np.zeros(parts.offset.size1()))
        if rows.upper is None:
            sides = [(expression == self._column(f"{rows.name} equals", -parts.offset))]
        else:
            sides = []
            for word, side in (("lower", rows.lower), ("upper", rows.upper)):
                finite = [i for i in range(side.size1()) if not _infinite(side[i])]
                if finite:
                    limit = self._column(f"{rows.name} {word}", (side - parts.offset)[finite])
                    left = expression[finite] if len(finite) < side.size1() else expression
                    sides.append(left >= limit if word == "lower" else left <= limit)
        return [constraint.set_label(rows.name) for constraint in sides]

    def _sum(self, name: str, slopes: dict[str, ca.SX]) -> Any:
        products = [self._product(f"{name} {variable}", s, self.variables[variable]) for variable, s in slopes.items()]
        return sum(products[1:], products[0]) if products else None

    def _product(self, name: str, slope: ca.SX, variable: Any) -> Any:
        numbers, factor = constant(slope), multiple_of_identity(slope)
        if factor is not None:
            return variable if factor == 1.0 else factor * variable
        if numbers is not None:
            return numbers @ variable
        if is_diagonal(slope):
            return multiply(self._parameter(name, ca.diag(slope), slope.shape[:1]), variable)
        return self._parameter(name, slope, slope.shape) @ variable

    def _column(self, name: str, column: ca.SX) -> Any:
        numbers = constant(column)
        return self._parameter(name, column, column.shape[:1]) if numbers is None else numbers[:, 0]

    def _parameter(self, name: str, value: ca.SX, shape: tuple[int, ...]) -> cvxpy.Parameter:
        label = plain = _identifier(name)
        count = 2
        while label in self.parameters:
            label, count = f"{plain}_{count}", count + 1
        self.parameters[label] = cvxpy.Parameter(shape, name=label)
        self._values[label] = value
        return self.parameters[label]


def _identifier(name: str) -> str:
    """Turn a declared name into what cvxpygen can make a C identifier of."""
    return re.sub(r"\W+", "_", name).strip("_")


def _infinite(side: ca.SX) -> bool:
    return bool(side.is_constant()) and bool(np.isinf(float(side)))
