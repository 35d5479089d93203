"""Metrics from frames whose answers can be worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks import Phase, Scenario, States, cell_record, get_scenario
from kinqp.benchmarks.metrics import FrameError, Ticks
from kinqp.benchmarks.metrics.motion import overshoot
from kinqp.formulations import Mode
from kinqp.solvers import Status

from .hand_made import ELBOW, NV, column, scenario, ticks_frame, times_frame

LOW = float(get_scenario("semicircle").robot.q_min[ELBOW])


def flat(frame: pl.DataFrame, whole: Scenario | None = None, times: pl.DataFrame | None = None) -> dict:
    return cell_record(frame, times, whole or scenario(len(frame))).flat()


def test_names_of_the_cell() -> None:
    record = cell_record(ticks_frame(3), None, scenario(3), formulation="f", solver="s", start="cold").flat()
    cell = {name: record[name] for name in ("scenario", "formulation", "solver", "start", "expects", "ticks", "loop")}
    assert cell == {
        "scenario": "by-hand", "formulation": "f", "solver": "s", "start": "cold", "expects": "solved", "ticks": 3,
        "loop": "closed",
    }  # fmt: skip
    assert not [name for name, value in record.items() if isinstance(value, float) and not np.isfinite(value)]


def test_iterations_and_changes_of_the_active_set() -> None:
    active = [[], ["a"], ["a", "b"], ["b", "c"], []]
    record = flat(ticks_frame(5, iterations=[0, 1, 2, 3, 9], active=active))
    assert [record[f"iterations_{k}"] for k in ("mean", "p99", "max")] == [3.0, 9.0, 9.0]
    # One joins, one joins, one leaves as one joins, two leave.
    assert [record[f"changes_{k}"] for k in ("mean", "p99", "max")] == [1.5, 2.0, 2.0]


def test_a_solver_that_tells_no_iterations_has_none() -> None:
    record = flat(ticks_frame(2, iterations=[None, None]))
    assert record["iterations_mean"] is None
    assert record["changes_max"] == 0.0


def test_success_and_honesty() -> None:
    frame = ticks_frame(
        8,
        status=["solved", "solved", "solved", "inaccurate", "primal_infeasible", "max_iterations", "failed", "solved"],
        claimed=["solved", "solved", "solved", "solved", "primal_infeasible", "max_iterations", "failed", "solved"],
        reference_error=[0.0, 1e-7, 1e-6, 0.5, float("nan"), float("nan"), float("nan"), 2e-6],
    )
    record = flat(frame)
    assert record["success"] == 0.5
    assert record["false_solved"] == 0.125
    assert record["false_unsolvable"] == 0.125
    assert record["gave_up"] == 0.25
    assert record["compared"] == 0.625
    assert record["agreement"] == 0.6
    assert record["reference_error_max"] == 0.5


def test_where_a_certificate_is_right_solved_is_the_lie() -> None:
    words = ["primal_infeasible", "primal_infeasible", "inaccurate", "max_iterations"]
    frame = ticks_frame(4, status=words, claimed=["primal_infeasible", "primal_infeasible", "solved", "max_iterations"])
    record = flat(frame, scenario(4, expects=Status.PRIMAL_INFEASIBLE))
    assert (record["success"], record["false_solved"], record["false_unsolvable"]) == (0.5, 0.25, 0.0)
    assert all(value is None for name, value in record.items() if name.startswith("requirement_"))


def test_residuals_in_physical_units() -> None:
    frame = ticks_frame(
        4,
        qd=column(4, values=[0.0, 0.02, -0.3, 0.0]),
        qd_lo=column(4, values=[-1.0, -1.0, -0.25, -1.0]),
        qd_hi=column(4, values=1.0),
        bound_violation=[0.0, 0.4, np.inf, 0.0],
        fixed_error=[1e-9, 0.0, np.inf, 3e-9],
    )
    record = flat(frame)
    assert record["sent_excess"] == pytest.approx(0.05)
    assert (record["proposed_excess"], record["proposed_fixed_error"], record["not_finite"]) == (0.4, 3e-9, 0.25)
    # The elbow's axis is the world's y at q = 0: what it turns with, the tool does.
    assert record["off_orientation"] == pytest.approx(0.3, rel=1e-12)
    assert record["off_line"] == 0.0


def test_off_the_line_in_metres_per_second() -> None:
    """Upright, joint 2 swings the tool 0.946 m above it; along the tool's z that is nothing, across it all."""
    whole = scenario(2)
    whole = replace(whole, phases=(Phase(Mode.line("z"), whole.guide, 0.002),))
    frame = ticks_frame(2, qd=column(2, joint=1, values=[0.0, 0.1]), v=np.zeros((2, 1)), eps=np.zeros((2, 1)))
    record = flat(frame, whole)
    assert record["off_line"] == pytest.approx(0.0946, rel=1e-9)
    assert record["off_orientation"] == pytest.approx(0.1, rel=1e-12)


def test_what_of_the_hands_motion_is_not_made() -> None:
    v = np.array([[0.1, 0.0, 0.0]] * 3 + [[5e-4, 0.0, 0.0]])
    eps = np.array([[0.0, 0.0, 0.0], [-0.05, 0.0, 0.0], [-0.03, 0.0, 0.04], [0.0, 0.0, 0.0]])
    record = flat(ticks_frame(4, v=v, eps=eps, task_scale=[1.0, 0.5, 0.7, 0.0]))
    assert record["task_error_linear"] == pytest.approx(0.025)
    assert record["task_error_angular"] is None
    # The last tick doesn't count: that hand is at rest.
    assert record["task_scale_loss"] == pytest.approx(0.8 / 3)
    assert record["time_lost"] == pytest.approx(0.8e-3)


def test_limits_and_accelerations() -> None:
    """The elbow moves onto its limit, is stopped at 20 rad/s^2 where 10 are allowed, and let 5 urad through it."""
    frame = ticks_frame(
        4, q=column(4, values=[LOW + 0.02e-3, LOW, LOW, LOW]), qd=column(4, values=[-0.02, 0.0, 0.0, -0.005])
    )
    record = flat(frame)
    assert record["peak_acceleration"] == record["watched_acceleration"] == pytest.approx(2.0)
    assert record["largest_jump"] == pytest.approx(0.02)
    assert record["on_limit"] == 0.75
    assert record["closest"] == 0.0
    assert record["limit_overshoot"] == pytest.approx(5e-6)
    # -2 g, +2 g, 0, -0.5 g: one change of sign in 4 ms.
    assert record["chatter"] == pytest.approx(250.0)
    # Twice the limit is not beyond twice the limit, but for rounding.
    slightly = flat(frame.with_columns(pl.Series("qd", column(4, values=[-0.0201, 0.0, 0.0, -0.005]).tolist())))
    assert slightly["jumps"] == pytest.approx(500.0)


def test_limits_of_the_scenario_are_what_counts() -> None:
    whole = scenario(2, inputs={"q_max": np.full(NV, 0.5), "qd_max": np.full(NV, 0.2)})
    record = flat(ticks_frame(2, q=column(2, values=[0.499, 0.5]), qd=column(2, values=[1e-3, 0.1])), whole)
    assert record["peak_speed"] == pytest.approx(0.5)
    assert record["limit_overshoot"] == pytest.approx(1e-4)


def test_overshoot_counts_from_where_a_joint_has_been() -> None:
    limits = np.array([-1.0]), np.array([1.0])
    for way, expected in (
        ([1.5, 1.2, 0.9], 0.0), ([1.5, 1.2, 1.3], 0.1), ([1.5, 0.9, 1.1], 0.1), ([0.0, -1.4, 0.0], 0.4),
    ):  # fmt: skip
        assert overshoot(np.array(way)[:, None], *limits) == pytest.approx(expected)


def test_independent_states_have_no_motion() -> None:
    zeros = np.zeros((2, NV))
    whole = replace(scenario(2), phases=(), states=States(Mode.fix_orientation(), zeros, zeros, np.zeros((2, 3))))
    record = flat(ticks_frame(2, qd=column(2, values=[0.0, 1.0])), whole)
    assert record["loop"] == "states"
    for name in ("peak_acceleration", "chatter", "jumps", "closest", "time_lost"):
        assert record[name] is None
    assert record["peak_speed"] == pytest.approx(1.0 / np.deg2rad(75.0))


def test_a_sample_of_a_loop_is_not_one() -> None:
    record = flat(ticks_frame(3, t=[0.0, 0.004, 0.009], qd=column(3, values=[0.0, 1.0, 0.0])), scenario(10))
    assert (record["loop"], record["ticks"]) == ("sampled", 3)
    assert record["peak_acceleration"] is None
    assert record["changes_mean"] is None
    assert record["requirement_unexpected"] is None
    assert record["requirement_constraints"] == pytest.approx(1.0)


def test_phases_may_guide_different_rows() -> None:
    whole = scenario(1)
    guide = whole.guide
    whole = replace(whole, phases=(Phase(Mode.line("z"), guide, 1e-3), Phase(Mode.fix_position(), guide, 1e-3)))
    frame = ticks_frame(2, phase=[0, 1], v=[[0.1], [0.3, 0.0, 0.4]], eps=[[0.02], [0.0, 0.0, 0.3]])
    ticks = Ticks(whole, frame)
    assert ticks.v.tolist() == [[0.0, 0.0, 0.1, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.3, 0.0, 0.4]]
    assert ticks.switched.tolist() == [False, True]
    record = flat(frame, whole)
    assert record["task_error_linear"] == pytest.approx(0.01)
    assert record["task_error_angular"] == pytest.approx(0.15)


def test_times_in_columns_that_are_never_mixed() -> None:
    update, solve = [None, 1e-4, 2e-4, 3e-4], [5e-4, 1e-4, 1e-4, 8e-4]
    times = times_frame(10, update, solve, wall_setup=[7e-4, None, None, None] * 10, c=[1e-6, 2e-6, 3e-6, 4e-6] * 10)
    record = flat(ticks_frame(4), times=times)
    assert (record["wall_samples"], record["wall_repeats"]) == (30, 10)
    assert (record["wall_p50"], record["wall_max"]) == (pytest.approx(3e-4), pytest.approx(1.1e-3))
    assert record["wall_mean"] == pytest.approx((2e-4 + 3e-4 + 11e-4) / 3)
    assert record["wall_late_1khz"] == record["update_late_4khz"] == pytest.approx(1 / 3)
    assert record["wall_late_4khz"] == pytest.approx(2 / 3)
    assert (record["update_p50"], record["solve_max"]) == (2e-4, 8e-4)
    assert (record["setup_samples"], record["setup_p99"]) == (10, 7e-4)
    assert (record["own_samples"], record["own_p50"], record["own_late_1khz"]) == (0, None, None)
    assert (record["c_samples"], record["c_p95"]) == (40, 4e-6)
    # Every repeat gave the same: nothing to doubt.
    assert record["wall_p95_low"] == record["wall_p95_high"] == record["wall_p95"]


def test_a_cell_without_times_has_none() -> None:
    for times in (None, times_frame(0, [1.0], [1.0])):
        record = flat(ticks_frame(2), times=times)
        assert (record["wall_samples"], record["wall_p50"], record["setup_p50"]) == (0, None, None)


def test_frames_of_something_else_are_refused() -> None:
    with pytest.raises(FrameError, match="expected 1 to 2 rows"):
        flat(ticks_frame(3), scenario(2))
    with pytest.raises(FrameError, match="expected a column 'sigma_min'"):
        flat(ticks_frame(2).drop("sigma_min"))
    with pytest.raises(FrameError, match="expected 3 entries in phase 0"):
        flat(ticks_frame(2, v=np.zeros((2, 2))))
    with pytest.raises(FrameError, match="times: expected a column 'own'"):
        flat(ticks_frame(2), times=times_frame(2, [1.0], [1.0]).drop("own"))
