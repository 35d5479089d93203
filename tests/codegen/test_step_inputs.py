"""What a compiled step takes: mistakes are named, parameters arrive, one call leaves nothing for the next."""

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from kinqp.control import make_step
from kinqp.formulations import InputError
from kinqp.solvers import Status
from tests.codegen.compiled import FORMULATIONS, REFERENCE_SOLVER, compiled, everything
from tests.codegen.lbr import Q, V, lbr
from tests.robots.arms import arm

Array = NDArray[np.float64]


@pytest.mark.parametrize(
    ("q", "v", "message"),
    [
        (Q, [0.1, np.nan, 0.0], "v: expected finite numbers"),
        (Q, [0.1, np.inf, 0.0], "v: expected finite numbers"),
        (Q, np.zeros(6), r"v: expected shape \(3,\) for mode fix-orientation \(rows vx, vy, vz\), got shape \(6,\)"),
        (Q, 0.1, r"v: expected shape \(3,\)"),
        (Q[:6], V, r"q: expected shape \(7,\) .* got shape \(6,\)"),
        (Q[:, None], V, r"q: expected shape \(7,\) .* got shape \(7, 1\)"),
        (np.full(7, -np.inf), V, "q: expected finite numbers"),
        ("home", V, "q: expected real numbers"),
    ],
)
def test_mistakes_are_named(q: object, v: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        lbr()(q, v)  # type: ignore[arg-type]  # that is the point


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"qd_maximum": 1.0}, r"qd_maximum: expected an input among .*qd_max.*, got 'qd_maximum'"),
        ({"qd_max": np.ones(6)}, r"qd_max: expected shape \(7,\)"),
        ({"qd_max": -1.0}, "qd_max: expected numbers above 0"),
        ({"qd_max": np.inf}, "qd_max: expected finite numbers"),
        ({"dt": np.nan}, "dt: expected finite numbers"),
        ({"q_max": np.nan}, "q_max: expected finite numbers"),
        ({"q_min": 1.0, "q_max": 0.5}, "q_min and q_max: expected q_min <= q_max at every joint"),
        ({"q_max": -3.5}, "q_min and q_max: expected q_min <= q_max at every joint"),
    ],
)
def test_mistakes_in_parameters_are_named_and_change_nothing(inputs: dict[str, object], message: str) -> None:
    step, before = lbr(), lbr()(Q, V)
    for call in (lambda: step(Q, V, qdd_max=1.0, **inputs), lambda: step.batch([Q], [V], qdd_max=1.0, **inputs)):
        with pytest.raises(InputError, match=message):
            call()
    assert step(Q, V).qd.tobytes() == before.qd.tobytes()


def test_q_and_v_are_not_taken_twice() -> None:
    with pytest.raises(InputError, match="q: expected an input among"):
        lbr().batch([Q], [V], q=Q)


@pytest.mark.parametrize(
    ("Q_given", "V_given", "message"),
    [
        (np.zeros((3, 6)), np.zeros((3, 3)), r"Q: expected shape \(3, 7\), got \(3, 6\)"),
        (np.zeros((3, 7)), np.zeros((2, 3)), r"V: expected shape \(3, 3\), got \(2, 3\)"),
        (np.zeros((3, 7)), np.zeros((3, 6)), r"V: expected shape \(3, 3\), got \(3, 6\)"),
        (np.zeros(7), np.zeros((7, 3)), r"Q: expected shape \(7, 7\), got \(7,\)"),
    ],
)
def test_batches_of_the_wrong_shape_are_refused(Q_given: Array, V_given: Array, message: str) -> None:
    with pytest.raises(InputError, match=message):
        lbr().batch(Q_given, V_given)


def test_parameters_hold_for_one_call() -> None:
    step = lbr()
    free = step(Q, V)
    slowest = 0.5 * float(np.abs(free.qd).max())
    held = step(Q, V, qd_max=slowest)
    assert held.status is Status.SOLVED
    assert np.abs(held.qd).max() <= slowest + 1e-9
    assert any(name.startswith("joint limits[") for name in held.active)
    assert step(Q, V).qd.tobytes() == free.qd.tobytes()
    many = step.batch([Q, Q], [V, V], qd_max=slowest)
    assert many.qd[1].tobytes() == held.qd.tobytes()
    assert step.batch([Q], [V]).qd[0].tobytes() == free.qd.tobytes()


def test_every_parameter_reaches_the_c_code() -> None:
    reference = make_step(arm("lbr_med14"), "cartesian-error", "fix-orientation", REFERENCE_SOLVER)
    rng = np.random.default_rng(8)
    q = Q + 0.05
    changes: dict[str, ArrayLike] = {
        "dt": 2e-3,
        "q_min": q - 1e-4,
        "q_max": q + 1e-4,
        "qd_max": rng.uniform(0.1, 0.4, 7),
        "qdd_max": 0.2,
        "task_weight": [1.0, 30.0, 0.2],
        "damping_threshold": 0.5,
        "damping_max": 0.3,
        "v_fixed": [0.01, -0.02, 0.005],
    }
    step = lbr()
    assert set(changes) == set(step.inputs)
    for name, value in changes.items():
        # How much damping there is at most only matters where there is some.
        others: dict[str, ArrayLike] = {"damping_threshold": 0.5} if name == "damping_max" else {}
        result = step(q, 8 * V, **others, **{name: value})
        wanted = reference(q, 8 * V, **others, **{name: value})
        assert result.status is wanted.status is Status.SOLVED
        np.testing.assert_allclose(result.qd, wanted.qd, rtol=0, atol=1e-9, err_msg=name)
        if name != "dt":  # here no limit is near enough for the period to matter
            assert np.abs(result.qd - step(q, 8 * V, **others).qd).max() > 1e-6, name


def test_a_batch_takes_a_row_for_each_tick_of_what_is_new_at_every_tick() -> None:
    rng = np.random.default_rng(12)
    Qs, Vs, drifts = Q + 0.1 * rng.normal(size=(5, 7)), 0.1 * rng.normal(size=(5, 3)), 0.01 * rng.normal(size=(5, 3))
    result = lbr().batch(Qs, Vs, v_fixed=drifts, qd_max=0.5)
    for i in range(5):
        assert result.qd[i].tobytes() == lbr()(Qs[i], Vs[i], v_fixed=drifts[i], qd_max=0.5).qd.tobytes()
    assert lbr().batch(Qs, Vs).qd.tobytes() == lbr().batch(Qs, Vs, v_fixed=np.zeros((5, 3))).qd.tobytes()
    for bad in (np.zeros(3), np.zeros((4, 3)), np.zeros((5, 2)), 0.0):
        with pytest.raises(InputError, match=r"v_fixed: expected shape \(5, 3\), one row for each tick, got"):
            lbr().batch(Qs, Vs, v_fixed=bad)
    with pytest.raises(InputError, match=r"v_fixed: expected real numbers, got entries of type <U4"):
        lbr().batch(Qs, Vs, v_fixed="none")
    drifts[2, 1] = np.nan
    assert [status is Status.FAILED for status in lbr().batch(Qs, Vs, v_fixed=drifts).status] == [
        i == 2 for i in range(5)
    ]


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_no_locked_rows_take_an_empty_drift(formulation: str) -> None:
    step = compiled("lbr_med14", formulation, "free", quick=True)
    v = np.concatenate([V, V])
    wanted = step(Q, v).qd
    if "v_fixed" in step.inputs:
        assert step(Q, v, v_fixed=[]).qd.tobytes() == wanted.tobytes()
        with pytest.raises(InputError, match="v_fixed: expected shape"):
            step(Q, v, v_fixed=np.zeros(3))


def test_inputs_without_defaults_are_asked_for() -> None:
    step = everything()
    q, v = np.zeros(6), np.zeros(3)
    with pytest.raises(InputError, match=r"qd_wish: expected shape \(6,\), got nothing"):
        step(q, v, qd_prev=np.zeros(6))
    with pytest.raises(InputError, match=r"qd_prev: expected shape \(6,\), got nothing"):
        step(q, v, qd_wish=np.zeros(6))
    with pytest.raises(InputError, match=r"qd_prev: expected shape \(1, 6\), got nothing"):
        step.batch([q], [v], qd_wish=np.zeros(6))
    with pytest.raises(InputError, match=r"qd_wish: expected shape \(6,\), got nothing"):
        step.batch([q], [v], qd_prev=np.zeros((1, 6)))
