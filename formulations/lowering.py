"""From a declaration to the canonical QP: one CasADi function from run-time inputs to QP data, and the rows' names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from .program import DeclarationError, QuadraticProgram
from .tick import Tick

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..robots import Robot
    from .base import Formulation
    from .modes import Mode
    from .tick_inputs import Input

DATA: Final = ("H", "g", "A", "b", "C", "l", "u", "lb", "ub", "K", "k", "x_feasible")
# Operations that CasADi differentiates to a constant although they are not affine.
_STEPS: Final = frozenset(
    {
        *(ca.OP_FLOOR, ca.OP_CEIL, ca.OP_SIGN, ca.OP_FMOD, ca.OP_REMAINDER, ca.OP_COPYSIGN),
        *(ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR),
    }
)


@dataclass(frozen=True)
class RowNames:
    """Names of the rows of the canonical QP.

    Attributes
    ----------
    equalities, inequalities : tuple of str
        One for each row of A and of C: the declared name and, in brackets, the index within it.
    box : tuple of str
        One for each variable; empty where the variable has no bounds.
    """

    equalities: tuple[str, ...]
    inequalities: tuple[str, ...]
    box: tuple[str, ...]


@dataclass(frozen=True)
class Lowered:
    """A formulation on a robot in a mode as one function.

    Attributes
    ----------
    formulation, robot, mode
        What was lowered.
    tick : Tick
        Its symbols.
    inputs : tuple of Input
        Run-time inputs of `function`, in its order.
    function : ca.Function
        Inputs by name, and the symbols of cuts, to `DATA`: the canonical QP; `K`, `k` with command = K x + k;
        `x_feasible` (empty if none was declared). Matrices come out as declared, not transposed.
    variables : dict of str to slice
        Where each declared variable stands in x.
    rows : RowNames
    constant : dict of str to ndarray of bool
        For each of `DATA`, which entries do not depend on the inputs.
    program : QuadraticProgram
        The declaration itself, term by term, in the symbols of `tick`.
    """

    formulation: Formulation
    robot: Robot
    mode: Mode
    tick: Tick
    inputs: tuple[Input, ...]
    function: ca.Function
    variables: dict[str, slice]
    rows: RowNames
    constant: dict[str, NDArray[np.bool_]]
    program: QuadraticProgram

    @property
    def symbols(self) -> tuple[ca.SX, ...]:
        """Arguments of `function`: the inputs' symbols, then those of the tick's cuts."""
        cut = (symbol for made in self.tick.cuts for symbol in made.symbols)
        return (*(given.symbol for given in self.inputs), *cut)

    @property
    def brakes(self) -> bool:
        """Whether the step is told the last command, so that its safe stop is braking and not zero at once."""
        return any(given.name == "qd_prev" for given in self.inputs)

    @property
    def n(self) -> int:
        """Number of variables."""
        return int(self.function.size1_out("g"))


def lower(formulation: Formulation, robot: Robot, mode: Mode, *, cut: bool = False) -> Lowered:
    """Find the canonical QP of a formulation on a robot in a mode.

    Parameters
    ----------
    formulation : Formulation
        What to lower.
    robot : Robot
        The arm.
    mode : Mode
        Its motion mode.
    cut : bool
        For generated C: leave to kernels what they compute better; see `Tick`.

    Raises
    ------
    DeclarationError
        Naming the term or rows that are not affine in the variables, a side that depends on them, or a missing
        command.
    """
    tick = Tick(robot, mode, formulation.bounds, cut=cut)
    # Inputs of every step, also of one that does not use them ...
    tick.declare_judged()
    # ... and what its safe stop or its promise needs.
    if formulation.safe_stop == "braking" or formulation.limits_acceleration:
        tick.declare_last_command()
    qp = QuadraticProgram()
    formulation.declare(qp, tick)
    if not qp.variables or qp.command_expression is None:
        missing = "command" if qp.variables else "variable"
        raise DeclarationError(f"{formulation.name}: expected at least one {missing}, got none")

    x = ca.vertcat(*qp.variables.values())
    n = x.size1()
    data = {"H": ca.SX(n, n), "g": ca.SX(n, 1)}
    for term in qp.terms:
        slope, offset = _affine(term.residual, x, f"{formulation.name}, {term.name}")
        if ca.depends_on(term.weight, x):
            raise DeclarationError(f"{formulation.name}, {term.name}: expected a weight free of the variables")
        weighted = ca.repmat(term.weight, 1, n) * slope
        data["H"] += slope.T @ weighted
        data["g"] += weighted.T @ offset
    for cost in qp.costs:
        data["g"] += _affine(cost.expression, x, f"{formulation.name}, {cost.name}")[0].T
    data["K"], data["k"] = _affine(qp.command_expression, x, f"{formulation.name}, command")
    if data["k"].size1() != robot.nv:
        raise DeclarationError(
            f"{formulation.name}, command: expected {robot.nv} rows, one for each joint, got {data['k'].size1()}"
        )
    rows, names = _lower_rows(qp, x, formulation.name)
    data |= rows
    data["x_feasible"] = _feasible_point(qp, formulation.name)

    # Not simplified: CasADi takes sums apart that both sides of a row share.
    dense = {name: ca.densify(data[name]) for name in DATA}
    cuts = [symbol for made in tick.cuts for symbol in made.symbols]
    function = ca.Function(
        "lowered",
        [*(given.symbol for given in tick.inputs), *cuts],
        [dense[name] for name in DATA],
        [*(given.name for given in tick.inputs), *(f"cut{k}" for k in range(len(cuts)))],
        list(DATA),
        # A run-time parameter may well be called b, as a right-hand side is here.
        {"allow_duplicate_io_names": True},
    )
    ends = np.cumsum([variable.size1() for variable in qp.variables.values()])
    variables = {
        name: slice(int(end) - variable.size1(), int(end))
        for end, (name, variable) in zip(ends, qp.variables.items(), strict=True)
    }
    constant = {name: _constant_entries(dense[name]) for name in DATA}
    return Lowered(formulation, robot, mode, tick, tick.inputs, function, variables, names, constant, qp)


def _affine(expression: ca.SX, x: ca.SX, label: str) -> tuple[ca.SX, ca.SX]:
    """Slope and offset of an expression in x, or an error naming it."""
    if any(ca.which_depends(expression, x, 2, True)) or _has_steps(expression, x):
        raise DeclarationError(f"{label}: expected an expression affine in the variables, got a nonlinear one")
    return ca.jacobian(expression, x), ca.substitute(expression, x, ca.SX.zeros(x.size1(), 1))


def _has_steps(expression: ca.SX, x: ca.SX) -> bool:
    """Whether x goes through one of `_STEPS`: nonlinear, though their derivatives do not depend on x."""
    others = [symbol for symbol in ca.symvar(expression) if not ca.depends_on(symbol, x)]
    function = ca.Function("walk", [x, *others], [expression])
    depends = [False] * function.sz_w()
    for k in range(function.n_instructions()):
        code, given, results = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_OUTPUT:
            continue
        tainted = given[0] == 0 if code == ca.OP_INPUT else any(depends[i] for i in given)
        if tainted and code in _STEPS:
            return True
        depends[results[0]] = tainted
    return False


def _lower_rows(qp: QuadraticProgram, x: ca.SX, formulation: str) -> tuple[dict[str, ca.SX], RowNames]:
    """Equalities to A and b, single-variable rows to the box, all else to C."""
    n = x.size1()
    parts: dict[str, list[ca.SX]] = {key: [] for key in ("A", "b", "C", "l", "u")}
    lb, ub = -np.inf * ca.SX.ones(n, 1), np.inf * ca.SX.ones(n, 1)
    equalities: list[str] = []
    inequalities: list[str] = []
    box = [""] * n
    for rows in qp.rows:
        label = f"{formulation}, {rows.name}"
        if rows.upper is None:
            slope, offset = _affine(rows.expression - rows.lower, x, label)
            parts["A"].append(slope)
            parts["b"].append(-offset)
            equalities += [f"{rows.name}[{i}]" for i in range(offset.size1())]
            continue
        slope, offset = _affine(rows.expression, x, label)
        if ca.depends_on(ca.vertcat(rows.lower, rows.upper), x):
            raise DeclarationError(f"{label}: expected sides free of the variables")
        for i in range(offset.size1()):
            name = f"{rows.name}[{i}]"
            low, high = rows.lower[i] - offset[i], rows.upper[i] - offset[i]
            column = _single_variable(slope[i, :])
            if column is not None and not box[column]:
                factor = float(slope[i, column])
                low, high = low / factor, high / factor
                lb[column], ub[column] = (low, high) if factor > 0.0 else (high, low)
                # A negative factor swaps the sides; the name says so, since reports speak of "lower" and "upper".
                box[column] = name if factor > 0.0 else f"-{name}"
            else:
                parts["C"].append(slope[i, :])
                parts["l"].append(low)
                parts["u"].append(high)
                inequalities.append(name)
    stacked = {
        key: ca.vertcat(*values) if values else ca.SX(0, n if key in "AC" else 1) for key, values in parts.items()
    }
    return stacked | {"lb": lb, "ub": ub}, RowNames(tuple(equalities), tuple(inequalities), tuple(box))


def _single_variable(row: ca.SX) -> int | None:
    """Column of a row's only entry, where that entry is a constant: its sign must be known to turn it into a bound."""
    columns: list[int] = row.sparsity().get_col()
    if len(columns) != 1 or not row[0, columns[0]].is_constant() or float(row[0, columns[0]]) == 0.0:
        return None
    return columns[0]


def _feasible_point(qp: QuadraticProgram, formulation: str) -> ca.SX:
    if not qp.feasible_values:
        return ca.SX(0, 1)
    missing = [name for name in qp.variables if name not in qp.feasible_values]
    if missing:
        raise DeclarationError(f"{formulation}, feasible point: expected a value for {', '.join(missing)}, got none")
    return ca.vertcat(*(qp.feasible_values[name] for name in qp.variables))


def _constant_entries(matrix: ca.SX) -> NDArray[np.bool_]:
    rows, columns = matrix.shape
    flags = [matrix[i, j].is_constant() for i in range(rows) for j in range(columns)]
    return np.array(flags, dtype=bool).reshape(rows, columns)
