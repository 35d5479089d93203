"""Performance profiles and geometric means of records made by hand."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks import geometric_means, performance_profile
from kinqp.benchmarks.metrics import RecordsError


def made(costs: dict[str, list[float | None]], failed: set[tuple[str, int]] = frozenset()) -> pl.DataFrame:
    rows = [
        {"scenario": f"s{k}", "formulation": "f", "start": "cold", "solver": solver, "wall_p50": cost,
         "success": 0.9 if (solver, k) in failed else 1.0}
        for solver, each in costs.items()
        for k, cost in enumerate(each)
    ]  # fmt: skip
    return pl.DataFrame(rows, schema_overrides={"wall_p50": pl.Float64})


def curve(profile: pl.DataFrame, solver: str) -> dict[float, float]:
    rows = profile.filter(pl.col("solver") == solver)
    return dict(zip(rows["tau"].to_list(), rows["share"].to_list(), strict=True))


def test_profile_by_hand() -> None:
    records = made({"a": [1.0, 2.0, 3.0, 8.0], "b": [2.0, 1.0, 3.0, 2.0]})
    profile = performance_profile(records)
    # Ratios: a 1, 2, 1, 4; b 2, 1, 1, 1.
    assert curve(profile, "a") == {1.0: 0.5, 2.0: 0.75, 4.0: 1.0}
    assert curve(profile, "b") == {1.0: 0.75, 2.0: 1.0, 4.0: 1.0}


def test_profile_of_those_who_fail_ends_below_one() -> None:
    records = made({"a": [1.0, 1.0, None, 1.0], "b": [2.0, 4.0, 5.0, 7.0]}, failed={("a", 1), ("a", 3), ("b", 3)})
    profile = performance_profile(records)
    # On the second and third b alone counts; nobody solved the last.
    assert curve(profile, "a") == {1.0: 0.25, 2.0: 0.25}
    assert curve(profile, "b") == {1.0: 0.5, 2.0: 0.75}
    assert curve(performance_profile(records, success=0.9), "a")[1.0] == 0.75


def test_geometric_means_by_hand() -> None:
    records = made({"a": [1.0, 1.0, 5.0, 1.0], "b": [2.0, 8.0, 1.0, None]}, failed={("b", 2)})
    means = geometric_means(records, "a")
    a, b = means.rows(named=True)
    assert (a["ratio"], a["low"], a["high"], a["problems"], a["left_out"]) == (1.0, 1.0, 1.0, 4, 0)
    assert b["ratio"] == pytest.approx(4.0)
    assert (b["problems"], b["left_out"]) == (2, 2)
    assert (b["low"], b["high"]) == (pytest.approx(2.0), pytest.approx(8.0))


def test_geometric_means_have_no_scale() -> None:
    """Seconds or microseconds, the same: what a shift of ten seconds would not give."""
    rng = np.random.default_rng(3)
    costs = {name: rng.lognormal(-11.0, 1.0, size=30).tolist() for name in "ab"}
    small = geometric_means(made(costs), "a")
    large = geometric_means(made({name: [1e6 * cost for cost in each] for name, each in costs.items()}), "a")
    for column in ("ratio", "low", "high"):
        assert small[column].to_list() == pytest.approx(large[column].to_list())
    ratio = small.filter(pl.col("solver") == "b").row(0, named=True)
    assert ratio["low"] < ratio["ratio"] < ratio["high"]


def test_nothing_in_common_has_no_ratio() -> None:
    means = geometric_means(made({"a": [1.0, None], "b": [None, 1.0]}), "a")
    assert means.rows()[1][1:] == (None, None, None, 0, 2)


def test_what_cannot_be_compared_is_refused() -> None:
    records = made({"a": [1.0], "b": [2.0]})
    with pytest.raises(RecordsError, match="expected a column 'wall_p42'"):
        performance_profile(records, "wall_p42")
    with pytest.raises(RecordsError, match="expected a solver among a, b, got 'c'"):
        geometric_means(records, "c")
    with pytest.raises(RecordsError, match="expected positive costs, got"):
        performance_profile(made({"a": [0.0]}))
    with pytest.raises(RecordsError, match="expected one cell of 'a'"):
        performance_profile(pl.concat([records, records]))
