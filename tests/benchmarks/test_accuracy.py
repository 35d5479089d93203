"""The accuracy part: what is run, what is compared with what."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinqp.benchmarks import Block, Cell, SweepConfig
from kinqp.benchmarks.accuracy import PreparedBlock
from kinqp.benchmarks.loop import task_scale
from kinqp.control import make_step, simulate
from tests.benchmarks.tiny import three_states, tiny, two_phases

if TYPE_CHECKING:
    import polars as pl

HERE = "tests.benchmarks.tiny:"
CONFIG = SweepConfig(timing_ticks=6, timing_window=3, sampled=("piqp",), samples=5)


def prepared(scenario: str, formulation: str = "joint-space") -> PreparedBlock:
    return PreparedBlock(Block(HERE + scenario, formulation), CONFIG)


def run(block: PreparedBlock, solver: str, start: str = "cold") -> pl.DataFrame:
    frame, part = block.run(Cell(block.block.scenario, block.block.formulation, solver, start))
    assert part.state == "done"
    assert part.ticks == len(frame)
    return frame


def test_a_closed_loop_is_that_of_simulate() -> None:
    frame = run(prepared("tiny"), "clarabel")
    s = tiny()
    expected = simulate(make_step(s.robot, "joint-space", s.mode, "clarabel"), s.guide, s.q0, s.duration, dt=s.dt)
    assert len(frame) == 20
    for name in ("q", "qd", "t", "fixed_error", "sigma_min"):
        np.testing.assert_array_equal(frame[name].to_numpy(), getattr(expected, name))
    np.testing.assert_array_equal(np.array(frame["eps"].to_list()), expected.eps)
    assert frame["iterations"].to_list() == expected.iterations.tolist()
    assert set(frame["status"]) == set(frame["claimed"]) == {"solved"}
    # One full set-up, then updates.
    assert frame["setup_time"][0] > 0.0
    assert (frame["setup_time"][1:] == 0.0).all()
    assert (frame["update_time"][1:] > 0.0).all()
    assert (frame["qd"].to_numpy() <= frame["qd_hi"].to_numpy() + 1e-9).all()
    assert (frame["qd_lo"].to_numpy() <= frame["qd"].to_numpy() + 1e-9).all()


def test_phases_follow_each_other_without_a_jump() -> None:
    frame = run(prepared("two_phases"), "active-set")
    scenario = two_phases()
    assert frame["phase"].to_list() == [0] * 8 + [1] * 6
    assert [len(v) for v in frame["v"]] == [3] * 8 + [1] * 6
    q, qd = frame["q"].to_numpy(), frame["qd"].to_numpy()
    np.testing.assert_array_equal(q[1:], q[:-1] + scenario.dt * qd[:-1])
    # The guide's time begins anew: at its start nothing is asked for but its pull back to its path.
    assert frame["setup_time"].to_numpy()[8] > 0.0


def test_states_are_solved_one_by_one_with_the_scenarios_inputs() -> None:
    frame = run(prepared("three_states"), "active-set")
    np.testing.assert_array_equal(frame["q"].to_numpy(), three_states().states.q)
    assert np.abs(frame["qd_hi"].to_numpy()).max() <= 0.1
    assert np.isnan(frame["task_scale"][1])
    assert not np.isnan(frame["task_scale"][2])


def test_slow_solvers_are_asked_some_of_the_references_states() -> None:
    block = prepared("tiny")
    all_ticks = run(block, "active-set")
    frame = run(block, "piqp")
    assert len(frame) == 5
    np.testing.assert_array_equal(frame["t"].to_numpy(), all_ticks["t"].to_numpy()[[0, 4, 9, 14, 19]])
    np.testing.assert_array_equal(frame["q"].to_numpy(), all_ticks["q"].to_numpy()[[0, 4, 9, 14, 19]])


def test_a_false_claim_is_seen_in_status_and_reference_error() -> None:
    frame = run(prepared("tiny"), HERE + "Lying")
    assert set(frame["claimed"]) == {"solved"}
    assert frame["status"].to_list() == ["solved", "inaccurate"] * 10
    # What is sent instead is zero velocity, not the reference's.
    assert frame["reference_error"][19] > 1e-4
    assert frame["reference_error"][18] < 1e-12


@pytest.mark.parametrize("formulation", ["cartesian-error", "hierarchical"])
def test_solvers_agree_with_the_reference(formulation: str) -> None:
    block = prepared("tiny", formulation)
    for solver, allowed in (("thesis-active-set", 1e-9), ("clarabel", 1e-6), ("active-set", 1e-13)):
        if (solver, formulation) == ("thesis-active-set", "hierarchical"):
            continue  # which gives it no feasible start
        error = run(block, solver)["reference_error"].to_numpy()
        assert not np.isnan(error).any(), solver
        assert error.max() <= allowed, solver


def test_warm_starts_change_iterations_and_not_answers() -> None:
    block = prepared("tiny", "joint-space-robust")
    cold, warm = run(block, "active-set"), run(block, "active-set", "active-set")
    np.testing.assert_allclose(warm["qd"].to_numpy(), cold["qd"].to_numpy(), atol=1e-12)
    assert warm["iterations"].sum() < cold["iterations"].sum()
    cold, warm = run(block, "casadi-qrqp"), run(block, "casadi-qrqp", "solution")
    np.testing.assert_allclose(warm["qd"].to_numpy(), cold["qd"].to_numpy(), atol=1e-9)
    assert warm["iterations"].sum() < cold["iterations"].sum()


def test_an_input_that_the_formulation_does_not_take_is_an_error() -> None:
    with pytest.raises(ValueError, match="the scenario gives wind, the formulation takes"):
        prepared("unknown_input")


def test_task_scale_by_hand() -> None:
    v = np.array([3.0, 4.0])
    assert task_scale(v, np.zeros(2)) == 1.0
    assert task_scale(v, -0.5 * v) == pytest.approx(0.5)
    assert task_scale(v, np.array([4.0, -3.0])) == pytest.approx(1.0)
    assert np.isnan(task_scale(np.zeros(2), v))
