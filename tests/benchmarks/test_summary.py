"""Metrics from ticks whose answers can be worked out by hand."""

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks import Spread, cell_metrics, get_scenario

SCENARIO = get_scenario("semicircle")


def test_percentiles_are_values_that_occurred() -> None:
    spread = Spread.of(np.arange(1.0, 201.0))
    assert (spread.samples, spread.mean, spread.max) == (200, 100.5, 200.0)
    assert (spread.p50, spread.p95, spread.p99) == (100.0, 190.0, 198.0)
    assert spread.std == pytest.approx(np.sqrt((200**2 - 1) / 12))


def frame() -> pl.DataFrame:
    """Four ticks: the elbow moves onto its limit, stays, and is sent 5 rad/s^2 back off it."""
    low = SCENARIO.robot.q_min[3]
    q = np.zeros((4, 7))
    q[:, 3] = [low + 0.02e-3, low, low, low]
    qd = np.zeros((4, 7))
    qd[:, 3] = [-0.02, 0.0, 0.0, 0.005]
    times = np.array([[9.0, 11.0], [1.0, 3.0], [2.0, 4.0], [5.0, 1.0]])
    return pl.DataFrame(
        {
            "status": ["solved", "solved", "failed", "solved"],
            "iterations": [1, 2, 3, 6],
            "fixed_error": [0.0, 1e-9, 0.0, 0.0],
            "bound_violation": [0.0, 0.0, 2e-9, 0.0],
            "q": pl.Series(q, dtype=pl.Array(pl.Float64, 7)),
            "qd": pl.Series(qd, dtype=pl.Array(pl.Float64, 7)),
            "eps": pl.Series(np.array([[3.0, 4.0, 0.0]] * 4), dtype=pl.Array(pl.Float64, 3)),
            "setup_time": pl.Series(times, dtype=pl.Array(pl.Float64, 2)),
            "solve_time": pl.Series(10.0 * times, dtype=pl.Array(pl.Float64, 2)),
        }
    )


def test_a_cell_is_summed_up() -> None:
    m = cell_metrics(frame(), SCENARIO)
    assert (m.ticks, m.repeats) == (4, 2)
    assert (m.iterations.mean, m.iterations.max) == (3.0, 6.0)
    # The first tick is the set-up's; the other three, two runs each, are update plus solve.
    assert m.setup == 10.0
    assert m.time.samples == 6
    assert m.time.max == pytest.approx(55.0)
    assert m.time.mean == pytest.approx(11.0 * 16.0 / 6.0)
    assert (m.fixed_error, m.bound_violation) == (1e-9, 2e-9)
    # From rest to -0.02 rad/s in 1 ms are 20 rad/s^2, twice the limit of 10.
    assert m.peak_acceleration == m.watched_acceleration == pytest.approx(2.0)
    assert m.failed == 0.25
    # On the limit at three of four ticks and, 5e-6 rad off it, no longer at the end.
    assert m.on_limit == pytest.approx(3 / 5)
    assert m.closest == 0.0
    assert m.task_error == pytest.approx(5.0)
