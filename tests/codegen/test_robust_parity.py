"""The robust formulations, compiled and interpreted, with a last command of every kind."""

import numpy as np
import pytest

from kinqp.formulations import InputError, Mode
from kinqp.solvers import Status
from tests.codegen.compiled import build_all, compiled, interpreted, ticks
from tests.codegen.test_parity import ROW_ROUNDING, TOLERANCE, check_safe, weakest_locked
from tests.formulations.reference import MODES, null_projector, rows_at
from tests.robots.arms import arm

ROBUST = ("joint-space-robust", "cartesian-error-robust")


def check(robot: str, formulation: str, mode: str, count: int) -> None:
    step, reference = compiled(robot, formulation, mode, quick=True), interpreted(robot, formulation, mode)
    rng = np.random.default_rng(9)
    held = 0
    for kind, q, v in ticks(robot, mode, count):
        # As it comes out of the loop, keeping the locked rows, or as it never should.
        qd_prev = arm(robot).qd_max * rng.uniform(-1.0, 1.0, len(q)) * rng.choice([0.0, 0.01, 0.1, 1.0])
        if rng.random() < 0.6:
            qd_prev = null_projector(rows_at(arm(robot), Mode.parse(mode), q)[1]) @ qd_prev
        case = f"{robot}, {formulation}, {mode}, {kind}, q={q!r}, v={v!r}, qd_prev={qd_prev!r}"
        result, wanted = step(q, v, qd_prev=qd_prev), reference(q, v, qd_prev=qd_prev)
        assert result.status is Status.SOLVED, case
        assert wanted.status is Status.SOLVED, case
        check_safe(step, result, q, case)
        scale = max(1.0, float(np.abs(wanted.qd).max()))
        # As in test_parity: near q = 0 two commands that keep a nearly dependent row equally well differ by more.
        allowed = max(TOLERANCE, 10.0 * ROW_ROUNDING / weakest_locked(step, q)) if "zero" in kind else TOLERANCE
        if wanted.sigma_min < 1e-5:
            # At the singularity itself the pull's direction is known to 1e-10 only (a condition of 1e6), and where the
            # gradient is flat it is stretched a hundredfold on top; 7e-8 was seen.
            allowed = max(allowed, 2e-7)
        assert np.abs(result.qd - wanted.qd).max() <= allowed * scale, case
        held += len(result.active) > 1
    assert held > count // 4


@pytest.mark.parametrize("formulation", ROBUST)
def test_compiled_and_interpreted_robust_steps_agree(formulation: str) -> None:
    cases = [("lbr_med14", formulation, "fix-orientation"), ("ur5e", formulation, "line:z")]
    build_all(cases)
    for robot, _, mode in cases:
        check(robot, formulation, mode, 18)


@pytest.mark.parametrize("formulation", ROBUST)
def test_batches_take_the_last_commands_and_accelerations_of_each_tick(formulation: str) -> None:
    step, robot = compiled("lbr_med14", formulation, "fix-orientation", quick=True), arm("lbr_med14")
    rng = np.random.default_rng(3)
    drawn = ticks("lbr_med14", "fix-orientation", 24, seed=3)
    Q, V = (np.array([tick[i] for tick in drawn]) for i in (1, 2))
    # Within the locked rows: what they force on the joints widens the jerk limit, up to all of the acceleration limit.
    free = [null_projector(rows_at(robot, Mode.parse("fix-orientation"), q)[1]) for q in Q]
    P = np.array([N @ (robot.qd_max * rng.uniform(-0.01, 0.01, 7)) for N in free])
    change = np.array([N @ (robot.qdd_max * rng.uniform(-0.5, 0.5, 7)) for N in free])
    change[::4], change[1::4, 2], change[2::4] = np.inf, -np.inf, 3.0 * change[2::4]
    many, unknown = step.batch(Q, V, qd_prev=P, qdd_prev=change), step.batch(Q, V, qd_prev=P)
    for i, (q, v, qd, qdd) in enumerate(zip(Q, V, P, change, strict=True)):
        one = step(q, v, qd_prev=qd, qdd_prev=qdd)
        assert one.qd.tobytes() == many.qd[i].tobytes()
        assert one.status is many.status[i]
        assert one.iterations == many.iterations[i]
    # What a tick is told is not left to the next one, nor to the next batch, and makes a difference where it is known.
    np.testing.assert_array_equal(many.qd[::4], unknown.qd[::4])
    assert (many.qd != unknown.qd).any(axis=1).sum() > 10
    np.testing.assert_array_equal(step.batch(Q, V, qd_prev=P).qd, unknown.qd)
    # The same for all, as any parameter.
    same = step.batch(Q, V, qd_prev=P, qdd_prev=change[3]).qd
    np.testing.assert_array_equal(same, step.batch(Q, V, qd_prev=P, qdd_prev=np.tile(change[3], (24, 1))).qd)


def test_last_accelerations_of_the_wrong_shape_or_without_a_number_are_named() -> None:
    step = compiled("lbr_med14", "joint-space-robust", "fix-orientation", quick=True)
    Q, V = np.zeros((3, 7)), np.zeros((3, 3))
    change = np.zeros((3, 7))
    with pytest.raises(InputError, match=r"qdd_prev: expected shape \(3, 7\), one row for each tick, got \(2, 7\)"):
        step.batch(Q, V, qd_prev=Q, qdd_prev=change[:2])
    with pytest.raises(InputError, match=r"qdd_prev: expected shape \(7,\).* got shape \(3,\)"):
        step.batch(Q, V, qd_prev=Q, qdd_prev=np.zeros(3))
    change[1, 4] = np.nan
    with pytest.raises(InputError, match="qdd_prev: expected numbers, got NaN in row 1"):
        step.batch(Q, V, qd_prev=Q, qdd_prev=change)


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("formulation", ROBUST)
@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e", "panda"])
def test_they_agree_on_many_states(robot: str, formulation: str, mode: str) -> None:
    check(robot, formulation, mode, 300)
