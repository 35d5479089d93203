"""Lowering: where rows go, what is constant, and the numbers against NumPy."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from kinqp.formulations import DEFAULT_JOINT_WEIGHT, CartesianError, Evaluator, JointSpace, Mode, QuadraticProgram, Tick
from tests.formulations.declared import lowered, with_qd
from tests.formulations.reference import (
    MODES,
    ONE_QP,
    adversarial_state,
    bounds_at,
    damped_inverse,
    evaluator,
    last_command,
    null_projector,
    rows_at,
)
from tests.robots.arms import arm

ROBOT = arm("ur5e")


def test_what_is_nonlinear_in_the_state_alone_is_affine() -> None:
    def residual(qp: QuadraticProgram, tick: Tick, x: ca.SX) -> None:
        q = tick.q
        qp.minimize(ca.if_else(q[0] > 0, x[0], 2 * x[0]) + ca.floor(q[1]) * x[1] + ca.sin(q[2]))

    instance = Evaluator(lowered(with_qd(residual)))(q=[-1.0, 2.5, 0.5, 0, 0, 0], v=np.zeros(3))
    row = np.array([2.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(instance.qp.H, np.outer(row, row), atol=1e-15)
    np.testing.assert_allclose(instance.qp.g, row * np.sin(0.5), atol=1e-15)


def _rows(qp: QuadraticProgram, tick: Tick, x: ca.SX) -> None:
    a = tick.parameter("a", 2.0)
    qp.between(np.array([-1.0, -2.0]), ca.vertcat(x[0], -2 * x[1] + 1), np.array([3.0, np.inf]), name="single")
    qp.between(-5.0, x[0], 5.0, name="again")
    qp.between(0.0, x[2] + x[3], 1.0, name="pair")
    qp.between(0.0, a * x[4], 1.0, name="factor")
    qp.equal(3 * x[5] + a, x[0] - 7, name="tie")
    qp.equal(ca.SX(0, 1), ca.SX(0, 1), name="none")


def test_rows_go_where_they_belong() -> None:
    low = lowered(with_qd(_rows))
    qp = Evaluator(low)(q=np.zeros(6), v=np.zeros(3)).qp
    inf = np.inf
    # -2 <= 1 - 2 x1 is x1 <= 1.5; the second bound on x0 stays a row, and so does what is scaled by an input.
    np.testing.assert_array_equal(qp.lb, [-1.0, -inf, -inf, -inf, -inf, -inf])
    np.testing.assert_array_equal(qp.ub, [3.0, 1.5, inf, inf, inf, inf])
    np.testing.assert_array_equal(qp.C, [[1, 0, 0, 0, 0, 0], [0, 0, 1, 1, 0, 0], [0, 0, 0, 0, 2, 0]])
    np.testing.assert_array_equal(qp.l, [-5.0, 0.0, 0.0])
    np.testing.assert_array_equal(qp.u, [5.0, 1.0, 1.0])
    np.testing.assert_array_equal(qp.A, [[-1, 0, 0, 0, 0, 3]])
    np.testing.assert_array_equal(qp.b, [-9.0])
    assert low.rows.box == ("single[0]", "-single[1]", "", "", "", "")
    assert low.rows.inequalities == ("again[0]", "pair[0]", "factor[0]")
    assert low.rows.equalities == ("tie[0]",)


def test_constant_entries_are_known() -> None:
    low = lowered(with_qd(_rows))
    np.testing.assert_array_equal(low.constant["C"][:2], np.ones((2, 6), dtype=bool))
    np.testing.assert_array_equal(low.constant["C"][2], [True, True, True, True, False, True])
    assert low.constant["A"].all()
    assert not low.constant["b"].any()
    assert low.constant["K"].all()
    assert all(low.constant[name].shape == low.function.size_out(name) for name in low.constant)


def test_constant_entries_do_not_change() -> None:
    for name in ONE_QP:
        step = evaluator("ur5e", name, "fix-orientation")
        rng = np.random.default_rng(0)
        one, two = (
            step(
                q=ROBOT.random_configuration(rng), v=rng.normal(size=3), v_fixed=rng.normal(size=3),
                **last_command(step, rng),
            )
            for _ in range(2)
        )  # fmt: skip
        for key in ("H", "g", "A", "b", "C", "l", "u", "lb", "ub"):
            constant = step.lowered.constant[key].reshape(getattr(one.qp, key).shape)
            np.testing.assert_array_equal(getattr(one.qp, key)[constant], getattr(two.qp, key)[constant])


def test_objective_by_hand() -> None:
    """1/2 w (R x - r)^2, term by term."""
    rng = np.random.default_rng(1)
    R, r, w = rng.normal(size=(4, 6)), rng.normal(size=4), rng.uniform(0.1, 2, 4)

    def terms(qp: QuadraticProgram, tick: Tick, x: ca.SX) -> None:
        qp.minimize(ca.SX(R) @ x - r, w)
        qp.minimize(x - tick.parameter("wish", None, size=6), 0.25)

    low = lowered(with_qd(terms))
    wish = rng.normal(size=6)
    qp = Evaluator(low)(q=np.zeros(6), v=np.zeros(3), wish=wish).qp
    np.testing.assert_allclose(qp.H, R.T @ np.diag(w) @ R + 0.25 * np.eye(6), atol=1e-14)
    np.testing.assert_allclose(qp.g, -R.T @ (w * r) - 0.25 * wish, atol=1e-14)
    x = rng.normal(size=6)
    value = 0.5 * np.sum(w * (R @ x - r) ** 2) + 0.125 * np.sum((x - wish) ** 2)
    assert qp.objective(x) - qp.objective(np.zeros(6)) == pytest.approx(
        value - 0.5 * np.sum(w * r**2) - 0.125 * np.sum(wish**2), abs=1e-12
    )


def test_names_and_places_of_the_two_formulations() -> None:
    ce = evaluator("ur5e", "cartesian-error", "fix-orientation").lowered
    js = evaluator("ur5e", "joint-space", "fix-orientation").lowered
    limits = tuple(f"joint limits[{i}]" for i in range(6))
    assert (ce.rows.equalities, ce.rows.inequalities, ce.rows.box) == ((), limits, ("", "", ""))
    assert js.rows.equalities == (*(f"task[{i}]" for i in range(3)), *(f"mode[{i}]" for i in range(3)))
    assert (js.rows.inequalities, js.rows.box) == ((), ("", "", "", *limits))
    assert (ce.n, js.n) == (3, 9)
    assert js.variables == {"eps": slice(0, 3), "qd": slice(3, 9)}
    assert [given.name for given in ce.inputs][:2] == ["q", "v"]


@pytest.mark.parametrize(
    ("name", "bounds"), [("lbr_med14", "viable"), ("lbr_med14", "thesis"), ("ur5e", "viable"), ("panda", "viable")]
)
@pytest.mark.parametrize("mode", MODES)
def test_numbers_equal_those_assembled_in_numpy(name: str, mode: str, bounds: str) -> None:
    rng, robot, read = np.random.default_rng(2), arm(name), Mode.parse(mode)
    m, nv = read.m_free, robot.nv
    for _ in range(6):
        # Configurations from inside: there N_c is well conditioned, so that 1e-9 is meaningful.
        q = robot.random_configuration(rng)
        v, v_fixed, weight = rng.normal(size=m), rng.normal(size=read.m_fixed), rng.uniform(0.5, 2.0, m)
        J_free, J_fixed = rows_at(robot, read, q)
        low, high = bounds_at(robot, q, bounds)
        J_bar = J_free @ null_projector(J_fixed)
        J_sharp = damped_inverse(J_bar)
        qd_fixed = np.linalg.pinv(J_fixed) @ v_fixed if read.m_fixed else np.zeros(nv)
        qd_d = qd_fixed + J_sharp @ (v - J_free @ qd_fixed)
        start = J_free @ qd_fixed - v

        ce = evaluator(name, CartesianError(bounds), mode)(q=q, v=v, v_fixed=v_fixed, task_weight=weight)
        scale = 1.0 + float(np.abs(qd_d).max()) + float(np.abs(qd_fixed).max())
        expected = {
            "H": np.diag(weight), "g": np.zeros(m), "A": np.zeros((0, m)), "b": np.zeros(0), "C": J_sharp,
            "l": low - qd_d, "u": high - qd_d, "lb": np.full(m, -np.inf), "ub": np.full(m, np.inf),
            "x_feasible": start,
        }  # fmt: skip
        for key, value in expected.items():
            np.testing.assert_allclose(getattr(ce.qp, key), value, atol=1e-9 * scale, err_msg=key)
        np.testing.assert_allclose(ce.K, J_sharp, atol=1e-9 * scale)
        np.testing.assert_allclose(ce.k, qd_d, atol=1e-9 * scale)

        js = evaluator(name, JointSpace(bounds), mode)(q=q, v=v, v_fixed=v_fixed, task_weight=weight)
        mu = np.full(nv, DEFAULT_JOINT_WEIGHT)
        zero = np.zeros((read.m_fixed, m))
        expected = {
            "H": np.diag(np.concatenate((weight, mu))), "g": np.zeros(m + nv),
            "A": np.block([[-np.eye(m), J_free], [zero, J_fixed]]), "b": np.concatenate((v, v_fixed)),
            "C": np.zeros((0, m + nv)), "l": np.zeros(0), "u": np.zeros(0),
            "lb": np.concatenate((np.full(m, -np.inf), low)), "ub": np.concatenate((np.full(m, np.inf), high)),
            "x_feasible": np.concatenate((start, qd_fixed)),
        }  # fmt: skip
        for key, value in expected.items():
            np.testing.assert_allclose(getattr(js.qp, key), value, atol=1e-9 * scale, err_msg=key)
        np.testing.assert_array_equal(js.K, np.hstack((np.zeros((nv, m)), np.eye(nv))))
        np.testing.assert_array_equal(js.k, np.zeros(nv))

        for instance in (ce, js):
            for key, value in {"J_free": J_free, "J_fixed": J_fixed, "J_bar": J_bar}.items():
                np.testing.assert_allclose(getattr(instance, key), value, atol=1e-10, err_msg=key)
            np.testing.assert_allclose(instance.qd_lo, low, atol=1e-9)
            np.testing.assert_allclose(instance.qd_hi, high, atol=1e-9)


@pytest.mark.parametrize("name", ONE_QP)
def test_matrices_come_out_as_declared(name: str) -> None:
    """The function that code is generated from, and the evaluator, which transposes for speed, agree."""
    step = evaluator("lbr_med14", name, "rcm:-0.12")
    q = adversarial_state(arm("lbr_med14"), np.random.default_rng(7))
    v = np.array([0.1, -0.2, 0.3, 0.4])
    function = step.lowered.function
    last = last_command(step, np.random.default_rng(8))
    values = {given.name: given.default for given in step.lowered.inputs} | {"q": q, "v": v} | last
    out = function(**values)
    instance = step(q=q, v=v, **last)
    for key in ("H", "g", "A", "b", "C", "l", "u", "lb", "ub", "x_feasible"):
        np.testing.assert_array_equal(
            np.array(out[key]).reshape(getattr(instance.qp, key).shape), getattr(instance.qp, key)
        )
    np.testing.assert_array_equal(np.array(out["K"]), instance.K)
    np.testing.assert_array_equal(np.array(out["k"])[:, 0], instance.k)
