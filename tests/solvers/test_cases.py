"""Problems on which earlier versions were wrong: noise where zero is meant, unlike units, minimisers far away.

``cases/near_zero.npz`` holds their data, ``cases/near_zero.json`` what is right. ``LIPMWALK*`` and ``QUADCMPC3`` are
from qpbenchmark's set for model predictive control, ``Q*`` from Maros and Meszaros (``_rowscale``: rows multiplied by
powers of ten); the others are random ones, shrunk. Clarabel and HiGHS agree on the objectives; where there is no
solution, none of Clarabel, DAQP, HiGHS and PIQP finds a point.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from kinqp.solvers import QP, get_solver

FOLDER = Path(__file__).with_name("cases")
RIGHT = json.loads((FOLDER / "near_zero.json").read_text(encoding="utf-8"))
#: Beside it the project's own folder of public problems, too large to be part of it.
PUBLIC = Path(__file__).parents[3] / "shared" / "data" / "qp"
#: The objectives are given to six digits.
DIGITS = 1e-5


def load(name: str) -> QP:
    with np.load(FOLDER / "near_zero.npz") as file:
        return QP.trusted(**{key.split("/")[1]: file[key] for key in file if key.startswith(f"{name}/")})


@pytest.mark.parametrize("name", RIGHT)
def test_status_and_objective(name: str) -> None:
    qp, right = load(name), RIGHT[name]
    solution = get_solver("active-set").solve(qp)
    assert solution.status == right["right"], solution.message
    assert solution.told_the_truth
    if solution.solved:
        assert qp.objective(solution.x) == pytest.approx(right["objective"], rel=DIGITS, abs=1e-9)
        outside = np.maximum(np.maximum(qp.stacked @ solution.x - qp.upper, qp.lower - qp.stacked @ solution.x), 0)
        terms = np.abs(qp.stacked) @ (1 + np.abs(solution.x))
        assert (outside <= 1e-8 * np.where(terms > 0, terms, 1)).all()


@pytest.mark.parametrize("name", ["LIPMWALK4", "LIPMWALK10", "LIPMWALK12", "zero_row_noise", "zero_optimum"])
@pytest.mark.parametrize("solver", ["clarabel", "piqp"])
def test_our_judge_believes_others_that_are_right(name: str, solver: str) -> None:
    """A row of zeros with rounding in its bound is nobody's fault."""
    qp = load(name)
    solution = get_solver(solver).solve(qp)
    assert solution.solved, solution.message
    assert qp.objective(solution.x) == pytest.approx(RIGHT[name]["objective"], rel=DIGITS, abs=1e-8)


def test_rows_in_other_units_leave_the_answer() -> None:
    rng = np.random.default_rng(3)
    for name in ("QADLITTL_rowscale", "claimed_4833", "violated_n2"):
        qp = load(name)
        factors = 10.0 ** rng.integers(-6, 7, qp.m_eq + qp.m_ineq)
        e, f = np.split(factors, [qp.m_eq])
        other = QP.trusted(
            H=qp.H,
            g=qp.g,
            A=qp.A * e[:, None],
            b=qp.b * e,
            C=qp.C * f[:, None],
            l=qp.l * f,
            u=qp.u * f,
            lb=qp.lb,
            ub=qp.ub,
        )
        solution = get_solver("active-set").solve(other)
        assert solution.solved, solution.message
        assert qp.objective(solution.x) == pytest.approx(RIGHT[name]["objective"], rel=DIGITS)


@pytest.mark.skipif(not PUBLIC.is_dir(), reason=f"the public problems are not there: {PUBLIC}")
def test_public_problems() -> None:
    """Maros-Meszaros with up to 205 variables and qpbenchmark's set for model predictive control."""
    wrong = []
    for name, known in json.loads((PUBLIC / "index.json").read_text(encoding="utf-8")).items():
        with np.load(PUBLIC / f"{name}.npz") as file:
            qp = QP.trusted(**file)
        solution = get_solver("active-set").solve(qp)
        if not solution.solved or qp.objective(solution.x) != pytest.approx(known["objective"], rel=1e-6, abs=1e-6):
            wrong.append(f"{name}: {solution.status} {qp.objective(solution.x)}, {solution.message}")
    assert not wrong, "\n".join(wrong)
