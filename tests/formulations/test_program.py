"""Declaring and lowering: what is refused, where rows go, and the numbers against NumPy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np
import pytest

from kinqp.formulations import (
    DEFAULT_JOINT_WEIGHT,
    CartesianError,
    DeclarationError,
    Evaluator,
    Formulation,
    JointSpace,
    Lowered,
    Mode,
    QuadraticProgram,
    Tick,
    available_formulations,
    get_formulation,
    lower,
)
from kinqp.solvers import PluginError, UnknownOptionError, solve
from tests.finite_differences import difference_jacobian
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

if TYPE_CHECKING:
    from collections.abc import Callable

    Declare = Callable[[QuadraticProgram, Tick], object]

ROBOT = arm("ur5e")


@dataclass(frozen=True)
class Declared(Formulation):
    """Declares whatever it is given."""

    declaration: Declare | None = None

    name: ClassVar[str] = "declared"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        assert self.declaration is not None
        self.declaration(qp, tick)


def lowered(declaration: Declare, mode: str = "position") -> Lowered:
    return lower(Declared(declaration=declaration), ROBOT, Mode.parse(mode))


def with_qd(more: Callable[[QuadraticProgram, Tick, ca.SX], object]) -> Declare:
    """Start from six joint velocities that are the command."""

    def declaration(qp: QuadraticProgram, tick: Tick) -> None:
        qd = qp.variable("qd", 6)
        qp.command(qd)
        more(qp, tick, qd)

    return declaration


def _twice(act: Callable[[], object]) -> None:
    act()
    act()


REFUSED_AT_ONCE: list[tuple[str, Callable[[QuadraticProgram, ca.SX], object]]] = [
    ("variable x: expected a new name, it is declared already", lambda qp, _: qp.variable("x", 2)),
    ("variable y: expected a size of at least 1, got 0", lambda qp, _: qp.variable("y", 0)),
    (r"term 1: expected a column as residual, got shape \(1, 3\)", lambda qp, x: qp.minimize(x.T)),
    (r"speed: expected a column as residual, got shape \(1, 3\)", lambda qp, x: qp.minimize(x.T, name="speed")),
    (r"speed: expected one weight or 3, got shape \(2, 1\)", lambda qp, x: qp.minimize(x, np.ones(2), name="speed")),
    (
        "speed: expected weights that are not negative",
        lambda qp, x: qp.minimize(x, np.array([1.0, -1e-9, 1.0]), name="speed"),
    ),
    ("speed: expected weights that are not negative", lambda qp, x: qp.minimize(x, np.nan, name="speed")),
    ("rows: expected a new name", lambda qp, x: _twice(lambda: qp.between(0, x, 1, name="rows"))),
    (r"rows: expected sides of shape \(3, 1\), got \(2, 1\)", lambda qp, x: qp.equal(x, np.ones(2), name="rows")),
    (r"rows: expected sides of shape \(3, 1\), got \(2, 1\)", lambda qp, x: qp.between(np.ones(2), x, 1, name="rows")),
    (r"rows: expected sides of shape \(3, 1\), got \(4, 1\)", lambda qp, x: qp.between(0, x, np.ones(4), name="rows")),
    (r"rows: expected a column, got shape \(1, 3\)", lambda qp, x: qp.equal(x.T, 0.0, name="rows")),
    ("command: expected one command", lambda qp, x: _twice(lambda: qp.command(x))),
    ("feasible point: expected variables among x, got y", lambda qp, _: qp.feasible(y=0.0)),
    (r"feasible point: expected x of shape \(3, 1\), got \(2, 1\)", lambda qp, _: qp.feasible(x=np.zeros(2))),
    (r"feasible point: expected x of shape \(3, 1\), got \(3, 2\)", lambda qp, _: qp.feasible(x=np.zeros((3, 2)))),
    (r"feasible point: expected x of shape \(3, 1\), got \(1, 3\)", lambda qp, x: qp.feasible(x=x.T)),
]


@pytest.mark.parametrize(("message", "act"), REFUSED_AT_ONCE)
def test_declaration_refuses(message: str, act: Callable[[QuadraticProgram, ca.SX], object]) -> None:
    qp = QuadraticProgram()
    x = qp.variable("x", 3)
    with pytest.raises(DeclarationError, match=f"^{message}"):
        act(qp, x)


def _nothing(qp: QuadraticProgram, tick: Tick) -> None:
    """Declare nothing."""


def _half_a_point(qp: QuadraticProgram, _tick: Tick, _qd: ca.SX) -> None:
    qp.variable("slack", 1)
    qp.feasible(qd=0.0)


REFUSED_AT_LOWERING: list[tuple[str, Declare]] = [
    ("declared: expected at least one variable, got none", _nothing),
    ("declared: expected at least one command, got none", lambda qp, _: qp.variable("x", 6)),
    (
        "declared, speed: expected a weight free of the variables",
        with_qd(lambda qp, _, x: qp.minimize(x, x[0], name="speed")),
    ),
    (
        "declared, wall: expected sides free of the variables",
        with_qd(lambda qp, _, x: qp.between(x[1:3], x[0:2], 1.0, name="wall")),
    ),
    (
        "declared, wall: expected sides free of the variables",
        with_qd(lambda qp, _, x: qp.between(0.0, x[0:2], x[1:3], name="wall")),
    ),
    (
        "declared, command: expected 6 rows, one for each joint, got 5",
        lambda qp, _: qp.command(qp.variable("x", 5)),
    ),
    (
        "declared, feasible point: expected a value for slack, got none",
        with_qd(_half_a_point),
    ),
]


@pytest.mark.parametrize(("message", "declaration"), REFUSED_AT_LOWERING)
def test_lowering_refuses(message: str, declaration: Declare) -> None:
    with pytest.raises(DeclarationError, match=f"^{message}"):
        lowered(declaration)


NONLINEAR: list[Callable[[ca.SX, ca.SX], ca.SX]] = [
    lambda x, _: x[0] * x[1],
    lambda x, _: x[0] ** 2,
    lambda x, q: ca.sin(x[0]) + q[0],
    lambda x, _: ca.fabs(x[2]),
    lambda x, _: ca.fmax(x[0], x[1]),
    lambda x, _: x[0] / (2 + x[1]),
    lambda x, _: ca.if_else(x[0] > 0, x[1], 2 * x[1]),
    # Their derivatives do not depend on x, and yet they are not affine.
    lambda x, _: ca.floor(x[0]) + x[1],
    lambda x, q: ca.sign(x[0]) * q[0],
    lambda x, q: ca.if_else(x[0] > q[0], 1, 2),
    lambda x, _: ca.fmod(x[0], 2),
]


@pytest.mark.parametrize("expression", NONLINEAR)
def test_a_nonlinear_expression_is_refused_wherever_it_stands(expression: Callable[[ca.SX, ca.SX], ca.SX]) -> None:
    def command(qp: QuadraticProgram, tick: Tick) -> None:
        x = qp.variable("x", 6)
        qp.command(ca.vertcat(x[:5], expression(x, tick.q)))

    places: dict[str, Declare] = {
        "slowness": with_qd(lambda qp, t, x: qp.minimize(expression(x, t.q), name="slowness")),
        "wall": with_qd(lambda qp, t, x: qp.equal(0.0, expression(x, t.q), name="wall")),
        "floor": with_qd(lambda qp, t, x: qp.between(-1.0, expression(x, t.q), 1.0, name="floor")),
        "command": command,
    }
    for name, declaration in places.items():
        with pytest.raises(
            DeclarationError, match=f"^declared, {name}: expected an expression affine in the variables"
        ):
            lowered(declaration)


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


@dataclass(frozen=True)
class DampedLeastSquares(Formulation):
    """A third formulation, as a user would write it."""

    name: ClassVar[str] = "damped-least-squares"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        qd = qp.variable("qd", tick.nv)
        qp.minimize(tick.J_free @ qd - tick.v, name="task")
        qp.minimize(qd, weight=tick.parameter("damping", 0.1, lowest=0.0) ** 2, name="damping")
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)


def test_a_formulation_in_a_few_lines_works_end_to_end() -> None:
    robot, rng = arm("lbr_med14"), np.random.default_rng(4)
    step = evaluator("lbr_med14", DampedLeastSquares(), "position")
    assert step.lowered.rows.box == tuple(f"joint limits[{i}]" for i in range(7))
    for damping in (0.1, 0.3):
        q, v = 0.5 * robot.random_configuration(rng), 0.1 * rng.normal(size=3)
        instance = step(q=q, v=v, damping=damping)
        assert instance.qp.x_feasible is None
        solution = solve(instance.qp)
        assert solution.solved
        J = robot.jacobian(q)[:3]
        expected = J.T @ np.linalg.solve(J @ J.T + damping**2 * np.eye(3), v)
        assert np.all(np.abs(expected) < 0.9 * instance.qd_hi)  # else the formula does not hold
        np.testing.assert_allclose(instance.K @ solution.x + instance.k, expected, atol=1e-6)
    # On a limit, towards it: the joint stops, and the rest goes on.
    q[3], v = robot.q_max[3], np.array([0.0, 0.0, -0.2])
    instance = step(q=q, v=v)
    solution = solve(instance.qp)
    assert solution.x[3] <= 1e-9
    np.testing.assert_array_equal(instance.qd_hi[3], 0.0)


def test_registry() -> None:
    assert available_formulations() == (
        "cartesian-error",
        "cartesian-error-acceleration",
        "cartesian-error-robust",
        "damped",
        "hierarchical",
        "joint-space",
        "joint-space-acceleration",
        "joint-space-robust",
        "joint-space-weighted",
        "minimum-acceleration-norm",
        "minimum-kinetic-energy",
        "minimum-torque-norm",
        "minimum-velocity-norm",
        "task-scaling",
    )
    assert get_formulation("cartesian-error") == CartesianError()
    assert get_formulation("joint-space", bounds="thesis") == JointSpace("thesis")
    assert get_formulation("joint-space(bounds=thesis)") == JointSpace("thesis")
    assert get_formulation("tests.formulations.test_program:DampedLeastSquares").name == "damped-least-squares"
    instance = DampedLeastSquares()
    assert get_formulation(instance) is instance
    with pytest.raises(PluginError, match="'nope' does not exist; the choices are cartesian-error, "):
        get_formulation("nope")
    with pytest.raises(PluginError, match="expected no options with an instance, got bounds"):
        get_formulation(instance, bounds="thesis")
    with pytest.raises(UnknownOptionError, match="'speed' does not exist; the choices are bounds"):
        get_formulation("joint-space", speed=1)
    with pytest.raises(ValueError, match=r"^bounds: expected one of thesis, viable, got 'square'"):
        JointSpace("square")
    with pytest.raises(ValueError, match=r"^bounds: expected one of thesis, viable, got 'square'"):
        Tick(ROBOT, Mode.free(), "square")


def test_parameters() -> None:
    tick = Tick(ROBOT, Mode.free())
    first = tick.parameter("gain", 2.0, size=3, unit="1/s")
    assert tick.parameter("gain", 5.0, size=3) is first
    given = tick.inputs[0]
    assert len(tick.inputs) == 1
    assert given.default is not None
    assert (given.name, given.size, given.unit, given.default.tolist()) == ("gain", 3, "1/s", [2.0, 2.0, 2.0])
    with pytest.raises(ValueError, match="parameter gain: expected its first size, 3, got 1"):
        tick.parameter("gain", 2.0)
    with pytest.raises(ValueError, match="parameter low: expected a finite default not below 0, got -1"):
        tick.parameter("low", -1.0, lowest=0.0)
    with pytest.raises(ValueError, match="parameter zero: expected a finite default above 0, got 0"):
        tick.parameter("zero", 0.0, lowest=0.0, positive=True)
    for bad in (np.nan, np.inf):
        with pytest.raises(ValueError, match="parameter odd: expected a finite default"):
            tick.parameter("odd", bad)
    with pytest.raises(ValueError, match="parameter odd: expected a default not below"):
        tick.parameter("odd", np.nan, may_be_infinite=True)


def test_what_is_not_asked_for_is_not_made() -> None:
    tick = Tick(ROBOT, Mode.fix_orientation())
    assert not tick.inputs
    _ = tick.qd_hi
    assert [given.name for given in tick.inputs] == ["q", "q_min", "q_max", "qd_max", "qdd_max", "dt"]


def test_an_unknown_force_limit_is_infinite() -> None:
    robot = arm("davinci5")
    tick = Tick(robot, Mode.position())
    assert tick.tau_max.shape == (5, 1)
    assert not np.isfinite(robot.tau_max).any()


@pytest.mark.parametrize("mode", [*MODES, "fix-position@tool"])
def test_rate_of_the_jacobian(mode: str) -> None:
    robot, read, rng = arm("lbr_med14"), Mode.parse(mode), np.random.default_rng(5)
    tick = Tick(robot, read)
    function = ca.Function("rate", [tick.q, tick.qd_prev], [tick.Jdot_qd])
    q, qd = robot.random_configuration(rng), rng.normal(size=7)

    def along(t: np.ndarray) -> np.ndarray:
        at = q + t[0] * qd
        return np.asarray(read.twist_map_at(robot.pose(at)) @ robot.jacobian(at) @ qd)

    expected = difference_jacobian(along, np.zeros(1))[:, 0]
    np.testing.assert_allclose(np.array(function(q, qd))[:, 0], expected, atol=1e-9)


def test_dynamics_are_those_of_the_arm() -> None:
    robot, rng = arm("lbr_med14"), np.random.default_rng(6)
    tick = Tick(robot, Mode.free())
    function = ca.Function("dynamics", [tick.q, tick.qd_prev], [ca.densify(tick.M), ca.densify(tick.h), tick.pose])
    q, qd = robot.random_configuration(rng), rng.normal(size=7)
    M, h, pose = (np.array(part) for part in function(q, qd))
    np.testing.assert_allclose(M, robot.mass_matrix(q), atol=1e-10)
    np.testing.assert_allclose(h[:, 0], robot.bias_forces(q, qd), atol=1e-9)
    np.testing.assert_allclose(pose, robot.pose(q), atol=1e-12)


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
