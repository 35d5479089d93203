"""A row of the table, from ticks and times whose figures can be worked out by hand."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks import Spread, cell_summary
from kinqp.benchmarks.metrics import cell_record
from kinqp.benchmarks.report.envelope import envelope
from tests.benchmarks.hand_made import ELBOW, column, scenario, ticks_frame

SCENARIO = scenario(4)


def test_percentiles_are_values_that_occurred() -> None:
    spread = Spread.of(np.arange(1.0, 201.0))
    assert (spread.samples, spread.mean, spread.max) == (200, 100.5, 200.0)
    assert (spread.p50, spread.p95, spread.p99) == (100.0, 190.0, 198.0)
    assert spread.std == pytest.approx(np.sqrt((200**2 - 1) / 12))


def ticks() -> pl.DataFrame:
    """Four ticks: the elbow moves onto its limit, stays, and is sent 5 rad/s^2 back off it."""
    low = SCENARIO.robot.q_min[3]
    q = np.zeros((4, 7))
    q[:, 3] = [low + 0.02e-3, low, low, low]
    qd = np.zeros((4, 7))
    qd[:, 3] = [-0.02, 0.0, 0.0, 0.005]
    return pl.DataFrame(
        {
            "t": [0.0, 0.001, 0.002, 0.003],
            "status": ["solved", "solved", "failed", "solved"],
            "iterations": [1, 2, 3, 6],
            "fixed_error": [0.0, 1e-9, 0.0, 0.0],
            "bound_violation": [0.0, 0.0, 2e-9, 0.0],
            "sigma_min": [0.1] * 4,
            "q": pl.Series(q, dtype=pl.Array(pl.Float64, 7)),
            "qd": pl.Series(qd, dtype=pl.Array(pl.Float64, 7)),
            "eps": [[3.0, 4.0, 0.0]] * 4,
        }
    )


def times() -> pl.DataFrame:
    """Two repeats of a set-up and two updates, in C as well."""
    return pl.DataFrame(
        {
            "wall_setup": [10.0, None, None, 20.0, None, None],
            "wall_update": [None, 1.0, 2.0, None, 3.0, 4.0],
            "wall_solve": [100.0, 10.0, 20.0, 100.0, 30.0, 40.0],
            "own": pl.Series([None] * 6, dtype=pl.Float64),
            "c": [5.0, 6.0, 7.0, 8.0, 9.0, 10.0],
        }
    )


def test_a_cell_is_summed_up() -> None:
    m = cell_summary(ticks(), times(), SCENARIO)
    assert m.ticks == 4
    assert (m.iterations.mean, m.iterations.max) == (3.0, 6.0)
    # Set-ups are apart; the other two ticks, two repeats each, are update plus solve.
    assert m.setup == 15.0
    assert m.time is not None
    assert m.time.samples == 4
    assert (m.time.p50, m.time.max) == (22.0, 44.0)
    assert m.c == 7.5
    assert np.isnan(m.own)
    assert (m.fixed_error, m.bound_violation) == (1e-9, 2e-9)
    # From rest to -0.02 rad/s in 1 ms are 20 rad/s^2, twice the limit of 10.
    assert m.peak_acceleration == m.watched_acceleration == pytest.approx(2.0)
    assert m.failed == 0.25
    assert m.on_limit == 0.75
    assert m.task_error == pytest.approx(5.0)


def test_without_times_or_a_closed_loop_there_are_no_figures() -> None:
    m = cell_summary(ticks(), None, SCENARIO)
    assert m.time is None
    assert np.isnan(m.setup)
    sampled = ticks().with_columns(pl.Series("t", [0.0, 0.5, 1.0, 1.5]))
    m = cell_summary(sampled, None, SCENARIO)
    assert np.isnan([m.peak_acceleration, m.watched_acceleration, m.on_limit]).all()
    assert m.failed == 0.25


def test_table_and_report_measure_a_run_by_its_own_limits() -> None:
    """Both of the same limits, those of the scenario, whatever the robot's are: all three halved here."""
    robot = SCENARIO.robot
    own = {"qdd_max": 5.0, "qd_max": 0.5 * robot.qd_max, "q_min": 0.5 * robot.q_min, "q_max": 0.5 * robot.q_max}
    narrow = scenario(4, inputs=own)
    frame = ticks_frame(
        4, q=column(4, values=[0.0, 0.0, 0.5 * robot.q_min[ELBOW], 0.0]), qd=column(4, values=[0.0, 0.01, 0.01, 0.0])
    )
    table, report = cell_summary(frame, None, narrow), cell_record(frame, None, narrow).motion
    # 0.01 rad/s within 1 ms: 10 rad/s^2.
    assert table.peak_acceleration == report.peak_acceleration == pytest.approx(2.0)
    assert table.watched_acceleration == report.watched_acceleration == pytest.approx(2.0)
    assert table.on_limit == report.on_limit == 0.25
    assert report.peak_speed == pytest.approx(0.01 / own["qd_max"][ELBOW])
    shown = envelope(narrow, ELBOW)
    assert shown is not None
    np.testing.assert_allclose(np.deg2rad(shown.q[[0, -1]]), [own["q_min"][ELBOW], own["q_max"][ELBOW]])
