"""Inputs in, numbers out: what is refused and how it is said, what is kept between calls and what is not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest

from kinqp.formulations import (
    DATA,
    DEFAULT_DT,
    Evaluator,
    Formulation,
    InputError,
    Instance,
    Mode,
    lower,
)
from kinqp.solvers import get_solver, solve
from tests.formulations.reference import MEMORYLESS, MODES, adversarial_state, bounds_at, evaluator, needs_masses
from tests.robots.arms import arm

if TYPE_CHECKING:
    from kinqp.formulations import QuadraticProgram, Tick

FORMULATIONS = MEMORYLESS
# Those without rows besides the joints' that are active where nothing is held back (a scale that is 1, a direction that
# is not taken).
LIMITS_ONLY = ("cartesian-error", "damped", "joint-space")
ROBOT = arm("lbr_med14")
Q = np.array([0.3, -0.7, 0.5, 1.1, -0.4, 0.9, 0.2])
V = np.array([0.1, 0.2, -0.1])
QP_FIELDS = tuple(name for name in DATA if name not in ("K", "k"))


def step(formulation: str = "cartesian-error", mode: str = "fix-orientation") -> Evaluator:
    return evaluator("lbr_med14", formulation, mode)


def same(one: Instance, two: Instance) -> bool:
    equal = [np.array_equal(getattr(one.qp, name), getattr(two.qp, name)) for name in QP_FIELDS]
    return all(equal) and np.array_equal(one.K, two.K) and np.array_equal(one.k, two.k)


@dataclass(frozen=True)
class Smooth(Formulation):
    """Needs an input without a default: the velocity before."""

    name: ClassVar[str] = "smooth"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        qd = qp.variable("qd", tick.nv)
        qp.minimize(qd - tick.qd_prev)
        qp.between(-tick.tau_max, tick.M @ (qd - tick.qd_prev) / tick.dt, tick.tau_max, name="forces")
        qp.command(qd)


NAN, INF = np.nan, np.inf
SHAPE_V = r"shape \(3,\) for mode fix-orientation \(rows vx, vy, vz\)"
BAD: list[tuple[dict[str, Any], str]] = [
    ({"q": [NAN, 0, 0, 0, 0, 0, 0]}, "q: expected finite numbers, got"),
    ({"q": [INF, 0, 0, 0, 0, 0, 0]}, "q: expected finite numbers, got"),
    ({"v": [0, NAN, 0]}, "v: expected finite numbers, got"),
    ({"v": [0, 0, -INF]}, "v: expected finite numbers, got"),
    ({"q": np.zeros(6)}, r"q: expected shape \(7,\) \[rad or m\], got shape \(6,\)"),
    ({"q": np.zeros((7, 1))}, r"q: expected shape \(7,\) \[rad or m\], got shape \(7, 1\)"),
    ({"q": 0.0}, r"q: expected shape \(7,\) \[rad or m\], got shape \(\)"),
    ({"v": np.zeros(6)}, rf"v: expected {SHAPE_V}, got shape \(6,\)"),
    ({"v": 0.1}, rf"v: expected {SHAPE_V}, got shape \(\)"),
    ({"v": "fast"}, "v: expected real numbers, got entries of type <U4"),
    ({"v": None}, "v: expected "),
    ({"v": [[1.0], [2.0, 3.0], []]}, r"v: expected real numbers, got \[\[1"),
    ({"speed": 1.0}, "speed: expected an input among q, v, .*, got 'speed'"),
    ({"v_fixed": [0, NAN, 0]}, "v_fixed: expected finite numbers, got"),
    ({"v_fixed": [0, 0]}, r"v_fixed: expected shape \(3,\) \[m/s, rad/s\], got shape \(2,\)"),
    ({"dt": 0.0}, "dt: expected numbers from 1e-05 to 1 s, got"),
    ({"dt": -1e-3}, "dt: expected numbers from 1e-05 to 1 s, got"),
    ({"dt": NAN}, "dt: expected finite numbers, got"),
    ({"dt": INF}, "dt: expected finite numbers, got"),
    ({"dt": [1e-3, 1e-3]}, r"dt: expected shape \(1,\) \[s\], got shape \(2,\)"),
    ({"qd_max": -1.0}, "qd_max: expected numbers above 0 rad/s or m/s, got"),
    ({"qd_max": [1, 1, 0, 1, 1, 1, 1]}, "qd_max: expected numbers above 0 rad/s or m/s, got"),
    ({"qd_max": INF}, "qd_max: expected finite numbers, got"),
    ({"qdd_max": -10.0}, r"qdd_max: expected numbers above 0 rad/s\^2 or m/s\^2, got"),
    ({"q_max": [NAN] * 7}, "q_max: expected finite numbers, got"),
    ({"q_min": np.zeros(3)}, r"q_min: expected shape \(7,\) \[rad or m\], got shape \(3,\)"),
    ({"task_weight": 0.0}, "task_weight: expected numbers above 0 -, got"),
    ({"damping_threshold": 0.0}, "damping_threshold: expected numbers above 0 m or rad, got"),
    ({"damping_max": -0.1}, "damping_max: expected numbers above 0 m or rad, got"),
]


@pytest.mark.parametrize(("bad", "message"), BAD)
def test_refuses_an_input_and_names_it(bad: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=f"^{message}"):
        step()(**({"q": Q, "v": V} | bad))


@pytest.mark.parametrize("missing", ["q", "v"])
def test_names_what_is_missing(missing: str) -> None:
    given = {name: value for name, value in (("q", Q), ("v", V)) if name != missing}
    with pytest.raises(
        InputError, match=rf"^{missing}: expected shape \(., ?\).*, got nothing|^{missing}: .*got nothing"
    ):
        step()(**given)


def test_an_input_without_a_default_is_required() -> None:
    evaluate = evaluator("lbr_med14", Smooth(), "position")
    with pytest.raises(InputError, match=r"^qd_prev: expected shape \(7,\) \[rad/s or m/s\], got nothing"):
        evaluate(q=Q, v=V)
    qd = np.linspace(-0.1, 0.1, 7)
    instance = evaluate(q=Q, v=V, qd_prev=qd, tau_max=INF)
    np.testing.assert_allclose(instance.qp.g, -qd, atol=1e-15)
    np.testing.assert_allclose(instance.qp.C, ROBOT.mass_matrix(Q) / DEFAULT_DT, atol=1e-7)
    assert np.isinf(instance.qp.u).all()
    assert np.isinf(instance.qp.l).all()


@pytest.mark.parametrize(("bad", "message"), [BAD[0], BAD[15]])
def test_a_refused_call_leaves_nothing_behind(bad: dict[str, Any], message: str) -> None:
    before = step()(q=Q, v=V)
    with pytest.raises(InputError, match=message):
        step()(**({"q": Q + 1, "v": 2 * V, "v_fixed": np.ones(3)} | bad))
    assert same(before, step()(q=Q, v=V))


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_parameters_are_for_one_call_only(formulation: str) -> None:
    evaluate = step(formulation)
    before = evaluate(q=Q, v=V)
    changes = {"task_weight": 3.0, "v_fixed": 0.1, "qd_max": 0.01, "q_max": -1.0, "dt": 1.0}
    known = {given.name for given in evaluate.inputs}
    assert {"v_fixed", "qd_max", "q_max", "dt"} <= known
    for name, value in ((name, value) for name, value in changes.items() if name in known):
        assert not same(before, evaluate(q=Q, v=V, **{name: value})), name
        assert same(before, evaluate(q=Q, v=V)), name


def test_a_scalar_stands_for_all_entries_of_an_input_with_a_default() -> None:
    for name, value in {
        "task_weight": 3.0,
        "v_fixed": 0.1,
        "qd_max": 0.5,
        "q_max": 2.0,
        "q_min": -INF,
        "dt": 1.0,
    }.items():
        size = next(given.size for given in step().inputs if given.name == name)
        assert same(step()(q=Q, v=V, **{name: value}), step()(q=Q, v=V, **{name: [value] * size})), name


def test_defaults_are_those_of_the_arm() -> None:
    limits = {name: getattr(ROBOT, name) for name in ("q_min", "q_max", "qd_max", "qdd_max")}
    assert same(step()(q=Q, v=V), step()(q=Q, v=V, dt=DEFAULT_DT, v_fixed=np.zeros(3), **limits))


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_results_are_copies(formulation: str) -> None:
    q, v = Q.copy(), V.copy()
    evaluate = step(formulation)
    first = evaluate(q=q, v=v)
    kept = {name: np.array(getattr(first.qp, name)) for name in QP_FIELDS}
    kept |= {name: np.array(getattr(first, name)) for name in ("K", "k", "J_free", "J_fixed", "J_bar", "qd_lo", "v")}
    q += 0.5
    v *= -3.0
    evaluate(q=q, v=v)
    first_again = {name: getattr(first.qp if name in QP_FIELDS else first, name) for name in kept}
    for name, value in kept.items():
        np.testing.assert_array_equal(first_again[name], value, err_msg=name)
    np.testing.assert_array_equal(first.v, V)
    # Writing into a result does not reach the next one either.
    first.K[:] = first.k[:] = NAN
    assert np.isfinite(evaluate(q=Q, v=V).K).all()
    assert np.isfinite(evaluate(q=Q, v=V).k).all()


@pytest.mark.parametrize("formulation", LIMITS_ONLY)
@pytest.mark.parametrize("side", ["upper", "lower"])
def test_active_rows_are_named(formulation: str, side: str) -> None:
    """Joint 3 on its limit, the hand pulling it on: that row holds back, on that side, and no other one."""
    evaluate = step(formulation)
    q, sign = Q.copy(), 1.0 if side == "upper" else -1.0
    q[3] = (ROBOT.q_max if side == "upper" else ROBOT.q_min)[3]
    free = evaluate(q=q, v=np.zeros(3), q_max=INF, q_min=-INF)
    # The hand moves such that without limits joint 3 would go outwards.
    v = 0.01 * sign * np.linalg.pinv(free.J_bar)[3] / np.linalg.norm(np.linalg.pinv(free.J_bar)[3])
    instance = evaluate(q=q, v=v)
    solution = solve(instance.qp)
    assert solution.solved
    assert evaluate.active_rows(instance.qp, solution) == (f"joint limits[3] {side}",)
    unhindered = evaluate(q=q, v=v, q_max=INF, q_min=-INF)
    assert evaluate.active_rows(unhindered.qp, solve(unhindered.qp)) == ()
    assert evaluate.active_rows(evaluate(q=q, v=-v).qp, solve(evaluate(q=q, v=-v).qp)) == ()


@pytest.mark.parametrize("formulation", LIMITS_ONLY)
@pytest.mark.parametrize("backend", ["clarabel", "piqp"])
def test_at_rest_on_limits_nothing_is_active(formulation: str, backend: str) -> None:
    """Interior-point multipliers are never quite zero; they must not be mistaken for a limit that holds back."""
    q = Q.copy()
    q[3], q[6] = ROBOT.q_max[3], ROBOT.q_min[6]
    instance = step(formulation)(q=q, v=np.zeros(3))
    solution = solve(instance.qp, backend)
    assert solution.solved
    assert step(formulation).active_rows(instance.qp, solution) == ()


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("mode", MODES)
def test_states_on_and_beyond_limits(formulation: str, mode: str) -> None:
    rng, evaluate, read = np.random.default_rng(8), step(formulation, mode), Mode.parse(mode)
    solver = get_solver("clarabel")
    for _ in range(10):
        q, v = adversarial_state(ROBOT, rng), rng.normal(size=read.m_free)
        instance = evaluate(q=q, v=v)
        low, high = bounds_at(ROBOT, q)
        np.testing.assert_allclose(instance.qd_lo, low, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(instance.qd_hi, high, rtol=1e-12, atol=1e-14)
        assert np.all(instance.qd_lo[q <= ROBOT.q_min] == 0.0)
        assert np.all(instance.qd_hi[q >= ROBOT.q_max] == 0.0)
        solution = solver.solve(instance.qp)
        assert solution.solved, solution.message
        qd = instance.K @ solution.x + instance.k
        assert np.all(qd <= high + 1e-6)
        assert np.all(qd >= low - 1e-6)


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "davinci5"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("mode", ["position", "free"])
def test_modes_without_locked_rows(name: str, formulation: str, mode: str) -> None:
    robot = arm(name)
    if needs_masses(formulation, robot):
        pytest.skip("masses unknown")
    evaluate = evaluator(name, formulation, mode)
    m = evaluate.lowered.mode.m_free
    rng = np.random.default_rng(9)
    for _ in range(3):  # more than once: buffers of size zero
        q = robot.random_configuration(rng)
        instance = evaluate(q=q, v=np.zeros(m), v_fixed=np.zeros(0))
        assert instance.J_fixed.shape == (0, robot.nv)
        assert instance.v_fixed.shape == (0,)
        np.testing.assert_array_equal(instance.J_bar, instance.J_free)
        np.testing.assert_allclose(instance.J_free, robot.jacobian(q)[:m], atol=1e-12)
        assert instance.qp.m_eq == (0 if formulation in ("cartesian-error", "damped") else m)
    with pytest.raises(InputError, match=r"^v_fixed: expected shape \(0,\)"):
        evaluate(q=q, v=np.zeros(m), v_fixed=np.zeros(3))


def test_observes_what_the_formulation_does_not_use() -> None:
    """A formulation without limits is judged against them all the same."""
    evaluate = evaluator("lbr_med14", Smooth(), "fix-orientation")
    q = Q.copy()
    q[1] = ROBOT.q_max[1]
    instance = evaluate(q=q, v=V, qd_prev=np.zeros(7), v_fixed=0.2)
    assert instance.qd_hi[1] == 0.0
    np.testing.assert_array_equal(instance.v_fixed, [0.2] * 3)
    np.testing.assert_allclose(instance.J_fixed, ROBOT.jacobian(q)[3:], atol=1e-12)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_same_input_same_output(formulation: str) -> None:
    rng = np.random.default_rng(10)
    fresh = Evaluator(lower(step(formulation).lowered.formulation, ROBOT, Mode.fix_orientation()))
    for _ in range(20):
        q, v = adversarial_state(ROBOT, rng), rng.normal(size=3)
        assert same(step(formulation)(q=q, v=v), fresh(q=q, v=v))


def test_crossed_limits_are_refused() -> None:
    robot = arm("lbr_med14")
    evaluate = evaluator("lbr_med14", "cartesian-error", "fix-orientation")
    with pytest.raises(InputError, match="expected q_min <= q_max at every joint"):
        evaluate(q=np.zeros(7), v=np.zeros(3), q_min=robot.q_max, q_max=robot.q_min)
