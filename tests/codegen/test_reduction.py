"""Substituting what equalities define leaves the same problem."""

import casadi as ca
import numpy as np
import pytest

from kinqp.codegen.reduction import Reduced, reduce
from kinqp.formulations import Lowered, Mode, get_formulation, lower
from kinqp.solvers import QP, Status, get_solver
from tests.codegen.compiled import FORMULATIONS, REFERENCE_SOLVER, Everything, interpreted, ticks
from tests.robots.arms import arm

FIELDS = ("H", "g", "A", "b", "C", "lower", "upper", "K", "k", "start")


def lowered(robot: str, formulation: str, mode: str) -> Lowered:
    chosen = Everything() if formulation == "everything" else get_formulation(formulation)
    return lower(chosen, arm(robot), Mode.parse(mode))


def numbers(given: Lowered, reduced: Reduced) -> ca.Function:
    outputs = [ca.densify(ca.SX(getattr(reduced, name))) for name in FIELDS]
    return ca.Function("reduced", [i.symbol for i in given.inputs], outputs, [i.name for i in given.inputs], FIELDS)


@pytest.mark.parametrize(
    ("robot", "mode"),
    [("lbr_med14", "fix-orientation"), ("lbr_med14", "rcm:-0.12"), ("ur5e", "free"), ("ur5e", "plane:1,-2,0.5")],
)
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_both_problems_have_the_same_command(robot: str, formulation: str, mode: str) -> None:
    given = lowered(robot, formulation, mode)
    reduced = reduce(given)
    function = numbers(given, reduced)
    defaults = {i.name: i.default for i in given.inputs if i.default is not None}
    whole = interpreted(robot, formulation, mode)
    solver = get_solver(REFERENCE_SOLVER)
    compared = 0
    for kind, q, v in ticks(robot, mode, 24, seed=5):
        if "zero" in kind:  # commands at dependent locked rows are compared in test_parity.py
            continue
        r = {name: np.asarray(value) for name, value in function(**defaults, q=q, v=v).items()}
        qp = QP(
            H=r["H"], g=r["g"][:, 0], A=r["A"], b=r["b"][:, 0], C=r["C"], l=r["lower"][:, 0], u=r["upper"][:, 0],
        )  # fmt: skip
        solution, wanted = solver.solve(qp), whole(q, v)
        assert solution.status is wanted.status is Status.SOLVED
        qd = r["K"] @ solution.x + r["k"][:, 0]
        np.testing.assert_allclose(qd, wanted.qd, rtol=0, atol=1e-7, err_msg=f"{kind}, q={q!r}, v={v!r}")
        # The declared point is zero motion, admissible here as well.
        start = r["start"][:, 0]
        np.testing.assert_allclose(r["K"] @ start + r["k"][:, 0], 0.0, atol=1e-12)
        assert (qp.C @ start <= qp.u + 1e-12).all()
        assert (qp.C @ start >= qp.l - 1e-12).all()
        compared += 1
    assert compared == 16


def test_the_error_of_joint_space_is_substituted() -> None:
    given = lowered("lbr_med14", "joint-space", "fix-orientation")
    reduced = reduce(given)
    assert (given.n, reduced.n) == (10, 7)
    assert (given.function.size1_out("b"), reduced.m_eq) == (6, 3)
    assert not reduced.diagonal
    assert reduced.k.is_zero()


def test_cartesian_error_stays_as_it_is() -> None:
    given = lowered("lbr_med14", "cartesian-error", "fix-orientation")
    reduced = reduce(given)
    assert (reduced.n, reduced.m_eq, reduced.m) == (3, 0, 7)
    assert reduced.diagonal


@pytest.mark.parametrize("formulation", [*FORMULATIONS, "everything"])
def test_rows_keep_their_names(formulation: str) -> None:
    given = lowered("ur5e", formulation, "fix-orientation")
    reduced = reduce(given)
    wanted = [*given.rows.inequalities, *filter(None, given.rows.box)]
    assert list(reduced.rows) == wanted
    assert len(reduced.rows) == reduced.m
    assert {f"joint limits[{i}]" for i in range(6)} <= set(reduced.rows)


def test_only_what_is_defined_alone_unbounded_and_with_a_unit_is_substituted() -> None:
    given = lowered("ur5e", "everything", "fix-orientation")
    reduced = reduce(given)
    # Of (eps, qd, double, slack) only eps goes: 2 double is no unit, slack is bounded.
    assert (given.n, reduced.n) == (3 + 6 + 2, 6 + 2)
    assert reduced.m_eq == 2
    assert reduced.start.shape == (0, 1)
