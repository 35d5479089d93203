"""Percentiles and their intervals, against numpy and against what intervals are for."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kinqp.benchmarks.metrics.intervals import ENOUGH_REPEATS, clusters, percentiles

LEVELS = (50.0, 95.0, 99.0, 99.9, 100.0)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=300), st.integers(1, 20))
def test_percentiles_are_values_that_occurred(values: list[float], count: int) -> None:
    array = np.array(values)
    cluster = np.arange(len(array)) % min(count, len(array))
    found = percentiles(array, cluster, LEVELS, resamples=20)
    assert [each.value for each in found] == np.percentile(array, LEVELS, method="inverted_cdf").tolist()
    assert all({each.low, each.high} <= set(values) for each in found)


def test_twice_the_same_is_the_same_and_seeds_differ() -> None:
    values = np.random.default_rng(1).exponential(size=1000)
    cluster = np.arange(1000) // 50
    once, again, other = (percentiles(values, cluster, LEVELS, seed=seed) for seed in (0, 0, 1))
    assert once == again != other


def test_resampling_draws_whole_clusters() -> None:
    """Two clusters, 0 and 1: a draw's median is 0 unless both draws are the second, a chance of a quarter."""
    values = np.repeat([0.0, 1.0], 30)
    (median,) = percentiles(values, np.repeat([0, 1], 30), (50.0,), resamples=4000)
    assert (median.low, median.value, median.high) == (0.0, 0.0, 1.0)
    # Of 60 clusters, each one value, hardly ever.
    (finer,) = percentiles(np.append(values[:45], np.ones(15)), np.arange(60), (25.0,), resamples=400)
    assert finer.high == 0.0


def test_intervals_cover_what_they_are_for() -> None:
    """Repeats that differ by more than their samples do: of 100 intervals of 95 % some 95 hold the median, 0."""
    rng = np.random.default_rng(7)
    covered = narrow = 0
    for _ in range(100):
        shift = rng.normal(size=20)
        values = (shift[:, None] + 0.3 * rng.normal(size=(20, 30))).ravel()
        repeat = np.repeat(np.arange(20), 30)
        (estimate,) = percentiles(values, clusters(np.tile(np.arange(30), 20), repeat), (50.0,))
        covered += estimate.low <= 0.0 <= estimate.high
        (naive,) = percentiles(values[::2], np.arange(300), (50.0,), resamples=50)
        narrow += naive.low <= 0.0 <= naive.high
    assert 85 <= covered <= 99
    # Samples drawn one by one, as if a repeat were not one state of the machine, would promise too much.
    assert narrow < 60


def test_repeats_are_clusters_where_there_are_enough() -> None:
    tick, repeat = np.tile(np.arange(5), ENOUGH_REPEATS), np.repeat(np.arange(ENOUGH_REPEATS), 5)
    assert clusters(tick, 10 * repeat).tolist() == repeat.tolist()


def test_blocks_of_consecutive_samples_where_there_are_not() -> None:
    tick, repeat = np.tile(np.arange(1000), 3), np.repeat(np.arange(3), 1000)
    mixed = np.random.default_rng(0).permutation(3000)
    cluster = clusters(tick[mixed], repeat[mixed])
    position = repeat[mixed] * 1000 + tick[mixed]
    assert np.array_equal(cluster, position // 50)
    assert clusters(np.arange(20_000), np.zeros(20_000, dtype=int)).max() == 99
    assert clusters(np.arange(5), np.zeros(5, dtype=int)).tolist() == [0, 1, 2, 3, 4]
