"""Finding solvers, and their options."""

from importlib.metadata import EntryPoint
from typing import Any, ClassVar

import numpy as np
import pytest

from kinqp.solvers import (
    QP,
    OptionError,
    PluginError,
    RawSolution,
    Solver,
    Status,
    UnknownOptionError,
    available_solvers,
    get_solver,
    solve,
)


class Zero(Solver):
    """Says zero, whatever it is asked."""

    name: ClassVar[str] = "zero"

    def __init__(self, *, tolerance: float = 1e-9) -> None:
        super().__init__(tolerance=tolerance)

    def _setup(self, qp: QP) -> None:
        self._update(qp)

    def _update(self, qp: QP) -> None:
        pass

    def _solve(self, qp: QP) -> RawSolution:
        zero = np.zeros(qp.n)
        return RawSolution(claimed=Status.SOLVED, x=zero, y=(), z=(), z_box=zero)


class NeedsMoon(Zero):
    name: ClassVar[str] = "needs-moon"
    requires: ClassVar[tuple[str, ...]] = ("moon_solver",)


def test_built_in_solvers_are_available() -> None:
    assert {"clarabel", "piqp", "thesis-active-set"} <= set(available_solvers())
    assert list(available_solvers()) == sorted(available_solvers())


@pytest.mark.parametrize("name", available_solvers())
def test_every_solver_declares_what_it_is(name: str) -> None:
    solver = get_solver(name, tolerance=1e-7)
    assert solver.name == name
    assert solver.tolerance == 1e-7
    assert solver.available()


def test_unknown_name_lists_choices_and_the_closest() -> None:
    with pytest.raises(PluginError, match=r"'clarabell?e'.*did you mean 'clarabel'.*piqp, thesis-active-set"):
        get_solver("clarabelle")


@pytest.mark.parametrize("spec", ["no_such_module:X", "kinqp.solvers:NoSuchClass", ":X"])
def test_what_cannot_be_loaded_says_why(spec: str) -> None:
    with pytest.raises(PluginError, match="cannot be loaded"):
        get_solver(spec)


@pytest.mark.parametrize("spec", ["kinqp.solvers:QP", "kinqp.solvers:Solver", "kinqp.solvers:solve"])
def test_what_is_no_solver_is_refused(spec: str) -> None:
    with pytest.raises(PluginError, match="concrete subclass of Solver"):
        get_solver(spec)


def test_instance_class_and_path_work_unregistered() -> None:
    instance = Zero()
    assert get_solver(instance) is instance
    assert get_solver(Zero, tolerance=1e-3).tolerance == 1e-3
    assert get_solver("kinqp.solvers.clarabel:Clarabel").name == "clarabel"
    with pytest.raises(PluginError, match="an instance takes no options"):
        get_solver(instance, tolerance=1e-3)


def test_missing_module_is_named() -> None:
    assert NeedsMoon.missing() == ("moon_solver",)
    assert not NeedsMoon.available()
    with pytest.raises(PluginError, match="'needs-moon' needs moon_solver, which is not installed"):
        get_solver(NeedsMoon)


def test_entry_points_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    group = "kinqp.solvers"
    offers = [
        EntryPoint("outside", "kinqp.solvers.piqp:Piqp", group),
        EntryPoint("broken", "no_such_module:X", group),
    ]
    monkeypatch.setattr("kinqp.solvers.plugins.entry_points", lambda **_: offers)
    assert "outside" in available_solvers()
    assert "broken" not in available_solvers()
    assert get_solver("outside").name == "piqp"
    with pytest.raises(PluginError, match="cannot be loaded"):
        get_solver("broken")


@pytest.mark.parametrize("name", available_solvers())
def test_options_are_checked(name: str) -> None:
    with pytest.raises(UnknownOptionError, match=r"'tolerence'.*did you mean 'tolerance'.*max_iterations"):
        get_solver(name, tolerence=1e-6)
    bad: list[dict[str, Any]] = [
        {"tolerance": 0.0},
        {"tolerance": -1.0},
        {"tolerance": np.nan},
        {"tolerance": np.inf},
        {"tolerance": "fine"},
        {"tolerance": True},
        {"max_iterations": 0},
        {"max_iterations": 2.5},
    ]
    for options in bad:
        with pytest.raises(OptionError, match=next(iter(options))):
            get_solver(name, **options)


@pytest.mark.parametrize("name", ["clarabel", "piqp"])
def test_settings_reach_the_backend_or_are_refused(name: str) -> None:
    qp = QP(H=np.eye(2), g=[-3, -2], C=[[1, 1]], u=[1], lb=[0, 0])
    assert solve(qp, name, settings={"max_iter": 1}).status is Status.MAX_ITERATIONS
    with pytest.raises(UnknownOptionError, match=r"'max_iters'.*did you mean 'max_iter'"):
        get_solver(name, settings={"max_iters": 1})
    with pytest.raises(OptionError, match="does not accept"):
        get_solver(name, settings={"max_iter": "many"})


def test_options_may_stand_behind_the_name() -> None:
    assert get_solver("clarabel(tolerance=1e-7)").tolerance == 1e-7


def test_solve_in_one_call() -> None:
    qp = QP(H=np.eye(2), g=[-1, 0])
    for solver in ("piqp", Zero, Zero()):
        assert solve(qp, solver=solver).claimed is Status.SOLVED
    np.testing.assert_allclose(solve(qp).x, [1, 0], atol=1e-8)
