"""Finding solvers by name."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, TypeGuard

from . import cvxpy_bridge, qpsolvers_bridge
from .active_set import ActiveSet
from .casadi_qrqp import CasadiQrqp
from .clarabel import Clarabel
from .piqp import Piqp
from .plugins import PluginError, Registry, parse_spec
from .solver import Solver
from .thesis_active_set import ThesisActiveSet

if TYPE_CHECKING:
    from .qp import QP
    from .solution import Solution

_BUILTIN: tuple[type[Solver], ...] = (
    ActiveSet,
    ThesisActiveSet,
    Clarabel,
    Piqp,
    CasadiQrqp,
)

#: Bridges to the solvers of other libraries, as ``family:member``.
_FAMILIES = (
    qpsolvers_bridge.FAMILY,
    cvxpy_bridge.FAMILY,
)

#: Installed packages offer more solvers in this entry-point group, as ``name = "module:Class"``.
ENTRY_POINT_GROUP = "kinqp.solvers"


def available_solvers(*, bridges: bool = False) -> tuple[str, ...]:
    """Names of the installed solvers, sorted; built-in ones win over entry points of the same name.

    Parameters
    ----------
    bridges
        Whether to add the solvers behind other libraries, such as ``qpsolvers:daqp`` and ``cvxpy:OSQP``. This imports
        those libraries, which takes seconds.
    """
    registry = _registry()
    names = []
    for name in registry.names():
        try:
            cls = registry.find(name)
        except PluginError:
            # A package that cannot be imported is not available; get_solver says why when it is asked for.
            continue
        if _is_solver(cls) and cls.available():
            names.append(name)
    if bridges:
        names += [name for family in _FAMILIES for name in family.names()]
    return tuple(sorted(names))


def get_solver(solver: str | Solver | type[Solver], /, **options: object) -> Solver:
    """Find a solver and construct it with its options.

    Parameters
    ----------
    solver
        A registered name, a bridged one as ``"qpsolvers:daqp"``, or ``"module:Class"``, optionally with options in
        brackets as in ``"clarabel(tolerance=1e-8)"``; a class; or an instance, which is returned as it is.
    **options
        Keyword arguments of the solver's constructor.

    Raises
    ------
    PluginError
        When there is no such solver, it is not installed, or options are given for an instance.
    UnknownOptionError
        When the solver has no option of that name.
    OptionError
        When an option has an impossible value.
    """
    if isinstance(solver, Solver):
        if options:
            raise PluginError(
                f"solver {solver.name!r}: an instance takes no options, but {', '.join(options)} came with it"
            )
        return solver
    if isinstance(solver, str):
        registry = _registry()
        spec, given = parse_spec("solver", solver)
        options = given | options
        cls = registry.find(spec)
    else:
        registry, spec, cls = _registry(solver), solver.name, solver
    if not _is_solver(cls):
        raise PluginError(f"solver {spec!r}: expected a concrete subclass of Solver, got {cls!r}")
    if not cls.available():
        raise PluginError(
            f"solver {spec!r} needs {', '.join(cls.missing())}, which is not installed: install it, "
            f"or use one of {', '.join(available_solvers())}"
        )
    return registry.make(spec, **options)


def solve(qp: QP, solver: str | Solver | type[Solver] = "active-set", **options: object) -> Solution:
    """Solve one QP; for a series of them, keep the solver from `get_solver` and call its `solve`."""
    return get_solver(solver, **options).solve(qp)


def _registry(*unregistered: type[Solver]) -> Registry[Solver]:
    classes = {cls.name: cls for cls in (*_BUILTIN, *unregistered)}
    # Registry uses its base for isinstance alone, so an abstract one is safe here.
    families = {family.name: family.find for family in _FAMILIES}
    return Registry("solver", ENTRY_POINT_GROUP, Solver, classes, families)  # type: ignore[type-abstract, arg-type]


def _is_solver(cls: object) -> TypeGuard[type[Solver]]:
    return inspect.isclass(cls) and issubclass(cls, Solver) and not inspect.isabstract(cls)
