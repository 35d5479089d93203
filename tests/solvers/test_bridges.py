"""The solvers of other libraries, through qpsolvers and cvxpy."""

import subprocess
import sys

import numpy as np
import pytest

from kinqp.solvers import QP, OptionError, PluginError, Status, UnknownOptionError, available_solvers, get_solver
from kinqp.solvers.catalogue import CATALOGUE, KnownQP
from kinqp.solvers.cvxpy_bridge import TOLERANCES
from kinqp.solvers.qpsolvers_members import MEMBERS
from tests.solvers.test_second_opinions import random_qp
from tests.solvers.test_solver import control_problem

FAILED = (Status.FAILED, Status.FAILED)
LIED = (Status.SOLVED, Status.INACCURATE)
# Right, but without a certificate to check.
NO_PROOF = {
    "infeasible-rows": (Status.PRIMAL_INFEASIBLE, Status.PRIMAL_INFEASIBLE),
    "infeasible-equality": (Status.PRIMAL_INFEASIBLE, Status.PRIMAL_INFEASIBLE),
    "unbounded": (Status.DUAL_INFEASIBLE, Status.DUAL_INFEASIBLE),
}
UNBOUNDED = {"unbounded": NO_PROOF["unbounded"]}
NO_REASON = dict.fromkeys(NO_PROOF, FAILED)

# What a solver is known to get wrong: problem -> (what it claims, what we make of it); None: that depends on rounding,
# but it is not solved. Solvers on this list are installed with kinqp's own dependencies and those of its tests.
KNOWN_FAILURES: dict[str, dict[str, tuple[Status, Status] | None]] = {
    "qpsolvers:clarabel": {},
    # qpsolvers drops what daqp and HiGHS say when they find nothing.
    "qpsolvers:daqp": {"tiny-row": LIED, **NO_REASON},
    "qpsolvers:highs": {"tiny-step": LIED, **NO_REASON},
    "qpsolvers:osqp": {"tiny-row": None, "beale": None},
    "qpsolvers:piqp": {},
    # Needs a regular H.
    "qpsolvers:quadprog": {
        **NO_PROOF,
        **dict.fromkeys(("semidefinite-unique", "flat-valley", "linear-programme", "unbounded"), FAILED),
    },
    "qpsolvers:scs": {},
    "cvxpy:CLARABEL": UNBOUNDED,
    "cvxpy:DAQP": NO_PROOF,
    "cvxpy:HIGHS": NO_PROOF,
    "cvxpy:OSQP": {"tiny-row": None, "beale": None, **UNBOUNDED},
    "cvxpy:PIQP": NO_PROOF,
    "cvxpy:SCS": UNBOUNDED,
}
BRIDGED = tuple(KNOWN_FAILURES)

# How far x and the multipliers may be off where that is more than the catalogue allows. HiGHS adds 1e-7 to the diagonal
# of H, cvxpy squares and sums up R x where R'R = H.
COARSE: dict[str, float] = {"qpsolvers:highs": 5e-6, "cvxpy:HIGHS": 5e-6, "cvxpy:DAQP": 5e-6}
COARSE_ON: dict[tuple[str, str], float] = {
    ("qpsolvers:highs", "badly-scaled"): 2e-3,
    ("cvxpy:HIGHS", "badly-scaled"): 2e-3,
}

each = pytest.mark.parametrize("name", BRIDGED)


def test_bridges_are_listed_only_when_asked_for() -> None:
    assert set(BRIDGED) <= set(available_solvers(bridges=True))
    assert list(available_solvers(bridges=True)) == sorted(available_solvers(bridges=True))
    native = available_solvers()
    assert set(native) <= set(available_solvers(bridges=True))
    assert {name.partition(":")[0] for name in set(available_solvers(bridges=True)) - set(native)} == {
        "qpsolvers",
        "cvxpy",
    }
    assert "cvxpy:SCIPY" not in available_solvers(bridges=True), "it solves linear programmes only"


def test_nothing_is_imported_before_a_bridge_is_used() -> None:
    code = """
import sys
from kinqp.solvers import available_solvers, get_solver
available_solvers()
assert not {"qpsolvers", "cvxpy", "casadi", "scipy"} & set(sys.modules), sys.modules.keys()
get_solver("qpsolvers:daqp")
assert "cvxpy" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@each
@pytest.mark.parametrize("known", CATALOGUE, ids=lambda known: known.name)
def test_bridged_solver_finds_the_known_answer(name: str, known: KnownQP) -> None:
    solution = get_solver(name).solve(known.qp)
    failures = KNOWN_FAILURES[name]
    if known.name in failures:
        assert not solution.solved
        assert failures[known.name] in (None, (solution.claimed, solution.status))
        assert solution.certificate is None or solution.status is not known.status
        assert solution.message
        return
    assert solution.status is solution.claimed is known.status, solution.message
    if known.status is not Status.SOLVED:
        assert solution.certificate is not None
        assert solution.certificate.proves(known.qp)
        return
    assert known.x is not None
    accuracy = COARSE_ON.get((name, known.name), max(known.accuracy, COARSE.get(name, 0.0)))
    assert known.qp.objective(solution.x) == pytest.approx(known.qp.objective(known.x), rel=1e-6, abs=1e-6)
    if known.x_unique:
        np.testing.assert_allclose(solution.x, known.x, rtol=0, atol=accuracy)
    if known.dual_unique:
        for mine, theirs in ((solution.y, known.y), (solution.z, known.z), (solution.z_box, known.z_box)):
            np.testing.assert_allclose(mine, theirs, rtol=accuracy, atol=accuracy)


@each
def test_multipliers_are_ours_in_order_and_sign(name: str) -> None:
    solver, reference = get_solver(name), get_solver("clarabel")
    for seed, (m_eq, m, box) in enumerate(((1, 6, True), (0, 6, False), (2, 0, True), (1, 5, False), (0, 0, True))):
        qp = random_qp(seed, 5, m_eq, m, box)
        solution, other = solver.solve(qp), reference.solve(qp)
        assert solution.solved, solution.message
        for field in ("x", "y", "z", "z_box"):
            np.testing.assert_allclose(getattr(solution, field), getattr(other, field), rtol=1e-5, atol=1e-5)


@each
def test_a_series_with_one_solver_is_as_good_as_new_ones(name: str) -> None:
    reused = get_solver(name)
    for seed in range(4):
        qp = control_problem(seed)
        one, two = reused.solve(qp), get_solver(name).solve(qp)
        assert one.solved, one.message
        assert two.solved, two.message
        for field in ("x", "y", "z", "z_box"):
            np.testing.assert_allclose(getattr(one, field), getattr(two, field), rtol=1e-6, atol=1e-6)


@each
def test_nan_is_not_passed_on(name: str) -> None:
    good = {"H": np.eye(2), "g": np.array([-1.0, 0.0]), "C": np.array([[1.0, 1.0]]), "u": np.array([0.5])}
    solver = get_solver(name)
    for field, value in good.items():
        solution = solver.solve(QP.trusted(**good | {field: np.full_like(value, np.nan)}))
        assert solution.status is Status.FAILED
        assert "NaN" in solution.message
    assert solver.solve(QP.trusted(**good)).solved


@each
def test_iterations_are_counted_where_the_library_passes_them_on(name: str) -> None:
    solution = get_solver(name).solve(control_problem(0))
    silent = name in ("qpsolvers:clarabel", "qpsolvers:daqp", "qpsolvers:highs")
    assert (solution.iterations is None) is silent
    assert silent or solution.iterations > 0


@each
def test_nothing_is_printed(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    for known in CATALOGUE[-5:]:
        get_solver(name).solve(known.qp)
    printed = capfd.readouterr()
    # HiGHS writes its name and licence once per process, before it can be told not to.
    assert printed.out == "" or (name.casefold().endswith(":highs") and printed.out.count("\n") <= 2)
    assert printed.err == ""


@each
def test_settings_are_the_library_s_own_and_unknown_ones_refused(name: str) -> None:
    with pytest.raises((OptionError, UnknownOptionError), match=f"{name}.*nonsense"):
        get_solver(name, settings={"nonsense": 1})
    with pytest.raises(UnknownOptionError, match=r"'tolerence'.*did you mean 'tolerance'"):
        get_solver(name, tolerence=1e-6)
    with pytest.raises(OptionError, match="tolerance"):
        get_solver(name, tolerance=0.0)
    # What the tolerance is applied to are settings, and thus exist.
    family, _, member = name.partition(":")
    options = MEMBERS[member].tolerances if family == "qpsolvers" else TOLERANCES[member]
    assert bool(options) is (name != "qpsolvers:quadprog")
    get_solver(name, settings=dict.fromkeys(options, 1e-8))


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("qpsolvers:osqp", {"max_iter": 1}),
        ("qpsolvers:scs", {"max_iters": 1}),
        ("qpsolvers:piqp", {"max_iter": 1, "backend": "dense"}),
        ("qpsolvers:clarabel", {"max_iter": 1}),
        ("cvxpy:CLARABEL", {"max_iter": 1}),
        ("cvxpy:OSQP", {"max_iter": 1}),
    ],
)
def test_settings_reach_the_solver(name: str, settings: dict[str, object]) -> None:
    assert get_solver(name, settings=settings).solve(control_problem(0)).status is Status.MAX_ITERATIONS


@pytest.mark.parametrize("name", ["qpsolvers:scs", "qpsolvers:osqp", "cvxpy:SCS"])
def test_tolerance_reaches_the_solver(name: str) -> None:
    qp = control_problem(0)
    coarse, fine = (get_solver(name, tolerance=tolerance).solve(qp) for tolerance in (1e-3, 1e-9))
    assert coarse.iterations < fine.iterations
    assert coarse.residuals.worst > fine.residuals.worst


def test_a_member_is_asked_for_by_name_with_options() -> None:
    solver = get_solver("qpsolvers:daqp(tolerance=1e-10)")
    assert (solver.name, solver.tolerance) == ("qpsolvers:daqp", 1e-10)
    assert type(solver) is type(get_solver("qpsolvers:daqp"))
    assert get_solver(type(solver), tolerance=1e-5).name == "qpsolvers:daqp"
    assert get_solver("cvxpy:HIGHS").handles_semidefinite
    assert not get_solver("qpsolvers:quadprog").handles_semidefinite


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "qpsolvers:dapq",
            r"finds no solver 'dapq' installed \(did you mean 'daqp'\?\); the choices are .*scs",
        ),
        ("cvxpy:clarabel", r"cvxpy finds no solver 'clarabel' installed \(did you mean 'CLARABEL'\?\); the choices"),
        ("cvxpy:SCIPY", "cvxpy finds no solver 'SCIPY' installed"),
        ("qpsolver:daqp", "cannot be loaded: No module named 'qpsolver'"),
        ("kinqp.solvers.qpsolvers_bridge:QpsolversBridge", "concrete subclass of Solver"),
        ("kinqp.solvers.cvxpy_bridge:CvxpyBridge", "concrete subclass of Solver"),
    ],
)
def test_what_is_not_there_is_said_in_one_sentence(name: str, message: str) -> None:
    with pytest.raises(PluginError, match=message):
        get_solver(name)


def test_a_bridge_to_a_library_that_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kinqp.solvers.families.find_spec", lambda _: None)
    assert available_solvers(bridges=True) == available_solvers()
    with pytest.raises(PluginError, match="'qpsolvers:daqp' needs qpsolvers, which is not installed"):
        get_solver("qpsolvers:daqp")


def test_an_unknown_member_of_qpsolvers_is_used_with_what_it_says_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """A solver without a line in the table works, with its own tolerance and one kind of failure."""
    from kinqp.solvers import qpsolvers_bridge

    monkeypatch.setattr(qpsolvers_bridge, "MEMBERS", {})
    solver = qpsolvers_bridge.bridge.__wrapped__("quadprog")()
    for known in CATALOGUE:
        solution = solver.solve(known.qp)
        assert solution.status is Status.SOLVED or solution.claimed is Status.FAILED
    assert solver.solve(CATALOGUE[1].qp).solved


def test_cvxpy_compiles_once_per_structure() -> None:
    solver = get_solver("cvxpy:CLARABEL")
    problems = []
    for qp in (control_problem(0), control_problem(1), control_problem(2, 3)):
        assert solver.solve(qp).solved
        problems.append(solver._problem)  # type: ignore[attr-defined]  # there is no other way to see it
    assert problems[0] is problems[1] is not problems[2]
    assert problems[2].is_dpp()
