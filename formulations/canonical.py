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
    from numpy.typing import NDArray

# The variable that stands for the command while cvxpy works out its affine map.
_COMMAND: Final = "kinqp command"


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
    parameters: tuple[Given, ...]
    blocks: tuple[Block, ...]


def canonicalise(problem: object, command: object, name: str) -> Canonical:
    """Have cvxpy work out the maps, after checking that it can.

    Parameters
    ----------
    problem : cvxpy.Problem
        DPP, a QP.
    command : cvxpy.Expression
        Affine in the problem's variables.
    name : str
        Of the formulation, for messages.

    Raises
    ------
    DeclarationError
        One sentence: what is not as it must be.
    """
    if not isinstance(problem, cvxpy.Problem):
        raise DeclarationError(f"{name}, problem: expected a cvxpy.Problem, got {problem!r}")
    if not isinstance(command, cvxpy.Expression):
        raise DeclarationError(f"{name}, command: expected a cvxpy expression of the joint velocities, got {command!r}")
    _check(problem, command, name)
    stand_in = cvxpy.Variable(command.shape, name=_COMMAND)
    sign = 1.0 if isinstance(problem.objective, cvxpy.Minimize) else -1.0
    objective = cvxpy.Minimize(sign * problem.objective.args[0])
    extended = cvxpy.Problem(objective, [*problem.constraints, stand_in == command])
    if not extended.is_dpp():
        raise DeclarationError(f"{name}, command: expected an expression that follows the rules of DPP, got {command}")
    attributes = CvxAttr2Constr(reduce_bounds=True)
    stuffing = ConeMatrixStuffing(quad_obj=True)
    chain = Chain(reductions=[Dcp2Cone(quad_obj=True), attributes, EliminateZeroSized(), stuffing])
    program, _ = chain.apply(extended)
    n = program.x.size
    replaced = {new: old for old, (new,) in attributes.var_id_map.items()}
    unknowns = _unknowns(extended, replaced, program)
    return Canonical(
        n=n,
        m=program.constr_size,
        P=program.P.tocsc(),
        q=program.q.tocsc(),
        A=program.A.tocsc(),
        unknowns=tuple(unknown for unknown in unknowns if unknown.name != _COMMAND),
        command=next(unknown for unknown in unknowns if unknown.name == _COMMAND),
        parameters=_parameters(extended, program),
        blocks=_blocks(problem, program),
    )


def _check(problem: cvxpy.Problem, command: cvxpy.Expression, name: str) -> None:
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
    if not command.is_affine():
        raise DeclarationError(f"{name}, command: expected an affine expression, got {command}")
    strangers = [v.name() for v in command.variables() if v.id not in {own.id for own in problem.variables()}]
    if strangers:
        raise DeclarationError(f"{name}, command: expected variables of the problem, got {', '.join(strangers)}")
    names: set[str] = set()
    for parameter in {p.id: p for p in (*problem.parameters(), *command.parameters())}.values():
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


def _unknowns(problem: cvxpy.Problem, replaced: dict[int, int], program: Any) -> list[Unknown]:
    own = {variable.id: variable for variable in problem.variables()}
    made: list[Unknown] = []
    names: set[str] = set()
    for variable in sorted(program.variables, key=lambda v: program.var_id_to_col[v.id]):
        start = program.var_id_to_col[variable.id]
        # Variables with attributes (nonneg, say) are replaced by plain ones and rows.
        original = own.get(replaced.get(variable.id, variable.id))
        # cvxpy numbers what has no name by a count that depends on all that was made before.
        named = original is not None and original.name() != f"var{original.id}"
        label = original.name() if original is not None and named else "x" if original is not None else "auxiliary"
        label = unique(label, names)
        made.append(Unknown(label, slice(start, start + variable.size), original is not None and label != _COMMAND))
    return made


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
