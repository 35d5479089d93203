"""A parametrised cvxpy problem as the affine map from its parameters to QP data, found by cvxpy's canonicalisation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import cvxpy
import numpy as np
from cvxpy.constraints.zero import Zero
from cvxpy.reductions.chain import Chain
from cvxpy.reductions.cvx_attr2constr import CvxAttr2Constr, lower_value
from cvxpy.reductions.dcp2cone.cone_matrix_stuffing import ConeMatrixStuffing
from cvxpy.reductions.dcp2cone.dcp2cone import Dcp2Cone
from cvxpy.reductions.eliminate_zero_sized import EliminateZeroSized

from .program import DeclarationError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

_POINT: Final = "feasible point, "


@dataclass(frozen=True)
class Unknown:
    """A variable of the canonical problem: name, columns, and whether the problem itself has it."""

    name: str
    columns: slice
    own: bool


@dataclass(frozen=True)
class Given:
    """A cvxpy Parameter: name, shape, value if it has one, and where its entries stand in the parameter vector.

    `entries[k]` is the entry, counted column by column, whose value stands at `start + k`. Attributes such as symmetry
    make cvxpy leave entries out.
    """

    name: str
    shape: tuple[int, ...]
    value: NDArray[np.float64] | None
    nonneg: bool
    signed: bool
    start: int
    entries: NDArray[np.int64]


@dataclass(frozen=True)
class Block:
    """Rows of the canonical problem that come from one constraint: A x + b = 0, or >= 0."""

    name: str
    rows: slice
    equality: bool


@dataclass(frozen=True)
class Canonical:
    """minimise 1/2 x'Px + q'x  subject to  A x + b = 0 or >= 0, every number affine in the parameters.

    Attributes
    ----------
    n, m : int
        Variables and rows.
    P, q, A : scipy sparse arrays, shapes (n^2, p), (n + 1, p), (m (n + 1), p)
        Times the parameter vector with 1 behind it: P, [q; d] and [A b], each column by column.
    unknowns : tuple of Unknown
    command : Unknown
        Equal to the command by the rows that define it.
    feasible : dict of str to Unknown
        Equal to what the feasible point says of the variables of these names.
    parameters : tuple of Given
    blocks : tuple of Block
    """

    n: int
    m: int
    P: Any
    q: Any
    A: Any
    unknowns: tuple[Unknown, ...]
    command: Unknown
    feasible: dict[str, Unknown]
    parameters: tuple[Given, ...]
    blocks: tuple[Block, ...]


def canonicalise(problem: object, command: object, name: str, feasible: Mapping[str, object]) -> Canonical:
    """Have cvxpy work out the maps, after checking that it can.

    Parameters
    ----------
    problem : cvxpy.Problem
        DPP, a QP.
    command : cvxpy.Expression
        Affine in the problem's variables.
    name : str
        Of the formulation, for messages.
    feasible : mapping of str to cvxpy.Expression or numbers
        A feasible point, by names of variables.

    Raises
    ------
    DeclarationError
        One sentence: what is not as it must be.
    """
    if not isinstance(problem, cvxpy.Problem):
        raise DeclarationError(f"{name}, problem: expected a cvxpy.Problem, got {problem!r}")
    if not isinstance(command, cvxpy.Expression):
        raise DeclarationError(f"{name}, command: expected a cvxpy expression of the joint velocities, got {command!r}")
    _check_problem(problem, name)
    expressions = {"command": command} | _feasible_point(problem, feasible, name)
    # Variables that stand for expressions, while cvxpy works out their affine maps with all else.
    stand_ins = {label: cvxpy.Variable(expression.shape) for label, expression in expressions.items()}
    definitions = [stand_ins[label] == expression for label, expression in expressions.items()]
    for (label, expression), definition in zip(expressions.items(), definitions, strict=True):
        _check_expression(problem, expression, definition, f"{name}, {label}")
    sign = 1.0 if isinstance(problem.objective, cvxpy.Minimize) else -1.0
    objective = cvxpy.Minimize(sign * problem.objective.args[0])
    extended = cvxpy.Problem(objective, [*problem.constraints, *definitions])
    _check_names(extended.parameters(), name)
    attributes = CvxAttr2Constr(reduce_bounds=True)
    stuffing = ConeMatrixStuffing(quad_obj=True)
    chain = Chain(reductions=[Dcp2Cone(quad_obj=True), attributes, EliminateZeroSized(), stuffing])
    program, _ = chain.apply(extended)
    replaced = {new: old for old, (new,) in attributes.var_id_map.items()}
    found = {variable: _columns(program, stand_in.id) for variable, stand_in in stand_ins.items()}
    known = {variable: Unknown(variable, columns, own=False) for variable, columns in found.items()}
    return Canonical(
        n=program.x.size,
        m=program.constr_size,
        P=program.P.tocsc(),
        q=program.q.tocsc(),
        A=program.A.tocsc(),
        unknowns=_unknowns(problem, replaced, program, {stand_in.id for stand_in in stand_ins.values()}),
        command=known["command"],
        feasible={label.removeprefix(_POINT): unknown for label, unknown in known.items() if label.startswith(_POINT)},
        parameters=_parameters(extended, program),
        blocks=_blocks(problem, program),
    )


def _check_problem(problem: cvxpy.Problem, name: str) -> None:
    if problem.is_mixed_integer():
        raise DeclarationError(f"{name}, problem: expected continuous variables, got integer or boolean ones")
    if any(leaf.is_complex() for leaf in (*problem.variables(), *problem.parameters())):
        raise DeclarationError(f"{name}, problem: expected real variables and parameters, got complex ones")
    for part, label in ((problem.objective, "objective"), *_labelled(problem)):
        if not part.is_dcp():
            raise DeclarationError(f"{name}, {label}: expected a convex problem by the rules of DCP, got {part}")
        if not part.is_dcp(dpp=True):
            raise DeclarationError(
                f"{name}, {label}: expected a DPP problem, which never multiplies two Parameters, got {part}"
            )
    alone = [(cvxpy.Problem(problem.objective), problem.objective, "objective")]
    alone += [(cvxpy.Problem(cvxpy.Minimize(0), [part]), part, label) for part, label in _labelled(problem)]
    for single, part, label in alone:
        if not single.is_qp():
            raise DeclarationError(f"{name}, {label}: expected a QP (quadratic objective, affine rows), got {part}")


def _feasible_point(problem: cvxpy.Problem, feasible: Mapping[str, object], name: str) -> dict[str, cvxpy.Expression]:
    own = {variable.name(): variable for variable in problem.variables()}
    point: dict[str, cvxpy.Expression] = {}
    for label, value in feasible.items():
        if label not in own:
            raise DeclarationError(f"{name}, {_POINT}{label}: expected a variable among {', '.join(own)}")
        expression = value if isinstance(value, cvxpy.Expression) else cvxpy.Constant(value)
        if expression.shape != own[label].shape or expression.variables():
            wanted = f"Parameters and numbers of shape {own[label].shape}"
            raise DeclarationError(f"{name}, {_POINT}{label}: expected {wanted}, got {expression}")
        point[_POINT + label] = expression
    return point


def _check_expression(problem: cvxpy.Problem, expression: cvxpy.Expression, definition: Any, label: str) -> None:
    if not expression.is_affine():
        raise DeclarationError(f"{label}: expected an affine expression, got {expression}")
    own = {variable.id for variable in problem.variables()}
    strangers = [variable.name() for variable in expression.variables() if variable.id not in own]
    if strangers:
        raise DeclarationError(f"{label}: expected variables of the problem, got {', '.join(strangers)}")
    if not definition.is_dcp(dpp=True):
        raise DeclarationError(f"{label}: expected an expression that follows the rules of DPP, got {expression}")


def _check_names(parameters: Sequence[cvxpy.Parameter], name: str) -> None:
    names: set[str] = set()
    for parameter in parameters:
        label = parameter.name()
        if not label.isidentifier() or label == f"param{parameter.id}":
            raise DeclarationError(
                f"{name}, parameter {label}: expected an identifier as name, as in Parameter(3, name='v')"
            )
        if label in names:
            raise DeclarationError(f"{name}, parameter {label}: expected one Parameter of this name, got two")
        names.add(label)


def _labelled(problem: cvxpy.Problem) -> list[tuple[Any, str]]:
    return [(c, c.label or f"constraint {k}") for k, c in enumerate(problem.constraints, start=1)]


def _columns(program: Any, variable: int) -> slice:
    start = program.var_id_to_col[variable]
    return slice(start, start + program.id_to_var[variable].size)


def _unknowns(
    problem: cvxpy.Problem, replaced: dict[int, int], program: Any, left_out: set[int]
) -> tuple[Unknown, ...]:
    own = {variable.id: variable for variable in problem.variables()}
    made: list[Unknown] = []
    names: set[str] = set()
    for variable in sorted(program.variables, key=lambda v: program.var_id_to_col[v.id]):
        if variable.id in left_out:
            continue
        # Variables with attributes (nonneg, say) are replaced by plain ones and rows.
        original = own.get(replaced.get(variable.id, variable.id))
        # cvxpy numbers what has no name by a count that depends on all that was made before.
        named = original is not None and original.name() != f"var{original.id}"
        label = original.name() if original is not None and named else "x" if original is not None else "auxiliary"
        made.append(Unknown(unique(label, names), _columns(program, variable.id), own=original is not None))
    return tuple(made)


def unique(name: str, names: set[str]) -> str:
    """Return a name that is not among `names` yet, and add it to them."""
    label, count = name, 2
    while label in names:
        label, count = f"{name}_{count}", count + 1
    names.add(label)
    return label


def _parameters(problem: cvxpy.Problem, program: Any) -> tuple[Given, ...]:
    originals = {parameter.name(): parameter for parameter in problem.parameters()}
    given: list[Given] = []
    for reduced in sorted(program.parameters, key=lambda p: program.param_id_to_col[p.id]):
        original = originals[reduced.name()]
        entries = np.arange(original.size).reshape(original.shape, order="F")
        if reduced.id != original.id:
            entries = lower_value(original, entries)
        given.append(
            Given(
                original.name(),
                original.shape,
                _value(original),
                original.is_nonneg(),
                original.is_nonpos(),
                program.param_id_to_col[reduced.id],
                np.asarray(entries, dtype=np.int64).flatten(order="F"),
            )
        )
    return tuple(given)


def _value(parameter: cvxpy.Parameter) -> NDArray[np.float64] | None:
    # cvxpy keeps values of parameters with `sparsity` apart, and gives those with `diag` as sparse arrays.
    value = parameter.value_sparse if parameter.attributes["sparsity"] else parameter.value
    if value is None:
        return None
    return np.asarray(value.toarray() if hasattr(value, "toarray") else value, dtype=float)


def _blocks(problem: cvxpy.Problem, program: Any) -> tuple[Block, ...]:
    labels = {constraint.id: label for constraint, label in _labelled(problem)}
    blocks: list[Block] = []
    row = 0
    for constraint in program.constraints:
        name = labels.get(constraint.id, "auxiliary")
        blocks.append(Block(name, slice(row, row + constraint.size), isinstance(constraint, Zero)))
        row += constraint.size
    return tuple(blocks)
