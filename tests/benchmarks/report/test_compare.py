"""`compare` catches what got worse and keeps quiet about what did not."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks import CompareError, Store, compare, get_scenario
from kinqp.benchmarks.compare_cell import compare_ticks, correctness
from kinqp.benchmarks.time_ratio import MIN_REPEATS, time_ratios

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SCENARIO = get_scenario("semicircle")
N = 6


def ticks(**changes: object) -> pl.DataFrame:
    columns: dict[str, object] = {
        "t": np.arange(N) * 1e-3,
        "q": [[0.1 * k, 0.0] for k in range(N)],
        "status": ["solved"] * N,
        "claimed": ["solved"] * N,
        "iterations": [3] * N,
        "fixed_error": [1e-15] * N,
        "bound_violation": [0.0] * N,
        "reference_error": [1e-12] * N,
    }
    return pl.DataFrame(columns | changes)


def only(a: pl.DataFrame, b: pl.DataFrame) -> tuple[str, str]:
    found = compare_ticks("cell", a, b, SCENARIO)
    assert len(found) == 1, found
    return found[0].measure, found[0].verdict


def test_the_same_is_no_finding() -> None:
    assert compare_ticks("cell", ticks(), ticks(), SCENARIO) == []


def test_iterations_are_compared_exactly() -> None:
    one_more, one_less = ticks(iterations=[3, 3, 4, 3, 3, 3]), ticks(iterations=[3, 3, 2, 3, 3, 3])
    assert only(ticks(), one_more) == ("iterations", "worse")
    assert only(ticks(), one_less) == ("iterations", "better")
    # The same in all and at most, elsewhere: neither better nor worse.
    assert only(one_more, ticks(iterations=[4, 3, 3, 3, 3, 3])) == ("iterations", "changed")
    # Less in all, but the worst case, which a controller must have time for, is worse.
    assert only(ticks(), ticks(iterations=[1, 1, 1, 1, 1, 4])) == ("iterations", "worse")


def test_iterations_at_other_states_are_not_compared() -> None:
    elsewhere = ticks(q=[[0.1 * k, 1e-3 if k == 2 else 0.0] for k in range(N)], iterations=[3, 3, 9, 3, 3, 3])
    assert only(ticks(), elsewhere) == ("states", "changed")


def test_runs_of_different_length_are_said_to_be_so() -> None:
    assert only(ticks(), ticks().head(4)) == ("ticks", "changed")


def test_answers_are_compared_exactly() -> None:
    gave_up = ticks(status=["solved"] * 5 + ["failed"], claimed=["solved"] * 5 + ["failed"])
    assert only(ticks(), gave_up) == ("failed ticks", "worse")
    assert only(gave_up, ticks()) == ("failed ticks", "better")
    lied = ticks(status=["solved"] * 5 + ["inaccurate"])
    assert {(f.measure, f.verdict) for f in compare_ticks("cell", gave_up, lied, SCENARIO)} == {
        ("dishonest ticks", "worse")
    }


def test_the_right_answer_may_be_a_certificate() -> None:
    expects = replace(SCENARIO, expects=type(SCENARIO.expects).PRIMAL_INFEASIBLE)
    proved = ticks(status=["primal_infeasible"] * N, claimed=["primal_infeasible"] * N)
    found = compare_ticks("cell", proved, ticks(), expects)
    assert [(f.measure, f.verdict, f.b) for f in found] == [("failed ticks", "worse", N)]


def test_residuals_count_above_their_threshold() -> None:
    assert compare_ticks("cell", ticks(), ticks(bound_violation=[5e-10] * N), SCENARIO) == []
    assert only(ticks(), ticks(bound_violation=[2e-9] * N)) == ("bound_violation", "worse")
    assert only(ticks(fixed_error=[1e-6] * N), ticks()) == ("fixed_error", "better")
    # NaN is where there is no reference, and no number to compare.
    assert compare_ticks("cell", ticks(), ticks(reference_error=[np.nan] * N), SCENARIO) == []


def test_a_cell_that_can_no_longer_be_run_is_worse() -> None:
    (worse,) = correctness("cell", "", "crashed")
    (better,) = correctness("cell", "crashed", "")
    assert (worse.verdict, better.verdict) == ("worse", "better")
    assert "crashed" in worse.text
    assert correctness("cell", "crashed", "crashed otherwise") == []


def times(factor: float = 1.0, *, repeats: int = 10, noise: float = 0.02, seed: int = 0) -> pl.DataFrame:
    """Lognormal times, with a part that whole repeats share; the first tick is a set-up."""
    rng = np.random.default_rng(seed)
    tick, repeat = np.tile(np.arange(50), repeats), np.repeat(np.arange(repeats), 50)
    state = noise * rng.normal(size=repeats)[repeat]
    seconds = factor * 1e-5 * np.exp(state + noise * rng.normal(size=tick.size))
    update = [None if t == 0 else 0.0 for t in tick]
    nothing = pl.Series([None] * tick.size, dtype=pl.Float64)
    return pl.DataFrame(
        {"tick": tick, "repeat": repeat, "wall_update": update, "wall_solve": seconds, "own": seconds / 2, "c": nothing}
    )


def test_ratios_by_each_clock_for_itself() -> None:
    found = {(one.clock, one.statistic): one for one in time_ratios(times(), times(2.0, seed=1))}
    assert set(found) == {("wall", "typical"), ("wall", "p99"), ("own", "typical"), ("own", "p99")}
    for one in found.values():
        assert one.low <= one.ratio <= one.high
        assert one.low > 1.8
        assert one.high < 2.2
        assert one.ticks == 49
    wall, own = found["wall", "typical"], found["own", "typical"]
    assert wall.a == pytest.approx(2.0 * own.a, rel=1e-9)


def test_noise_widens_the_interval_until_it_holds_one() -> None:
    calm = next(iter(time_ratios(times(noise=0.01), times(1.1, noise=0.01, seed=1))))
    restless = next(iter(time_ratios(times(noise=0.5), times(1.1, noise=0.5, seed=1))))
    assert calm.low > 1.0
    assert restless.low < 1.0 < restless.high


def test_too_few_repeats_give_no_ratio() -> None:
    assert time_ratios(times(), times(repeats=MIN_REPEATS - 1)) == []


def test_a_sweep_compared_with_itself_has_not_changed(candidate: Callable[[str], Store]) -> None:
    found = compare(candidate(""), candidate(""))
    assert (found.compared, found.timed, found.findings, found.only_a, found.only_b) == (2, 2, (), (), ())
    assert not found.regressed


def test_a_slowed_solver_is_caught(candidate: Callable[[str], Store]) -> None:
    found = compare(candidate(""), candidate("slow"))
    assert found.regressed
    slowed = [one for one in found.of("worse") if "Candidate" in one.cell]
    assert {one.measure for one in slowed} >= {"time wall typical [s]"}
    assert all(one.measure.startswith("time") for one in slowed), "its answers are the same"
    assert next(one.ratio for one in slowed if one.ratio) > 2.0
    assert not compare(candidate(""), candidate("slow"), times=False).regressed


def test_a_wrong_solver_is_caught(candidate: Callable[[str], Store]) -> None:
    found = compare(candidate(""), candidate("wrong"), times=False)
    worse = {one.measure: one for one in found.of("worse")}
    assert "dishonest ticks" in worse
    assert "failed ticks" in worse
    assert {one.cell for one in found.findings} == {next(iter(worse.values())).cell}, "nobody else is accused"
    back = compare(candidate("wrong"), candidate(""), times=False)
    assert not back.regressed
    assert "dishonest ticks" in {one.measure for one in back.of("better")}


def elsewhere(store: Store, folder: Path) -> Store:
    """The same results from another machine."""
    import shutil

    shutil.copytree(store.folder, folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["conditions"]["cpu"] = "Abacus"
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return Store(folder)


def test_times_of_different_machines_are_not_compared(candidate: Callable[[str], Store], tmp_path: Path) -> None:
    other = elsewhere(candidate("slow"), tmp_path / "other")
    found = compare(candidate(""), other)
    assert not found.times_compared
    assert not found.regressed
    assert any("cpu differs" in text and "Abacus" in text for text in found.warnings)
    assert any("--allow-other-machine" in text for text in found.warnings)
    assert compare(candidate(""), other, allow_other_machine=True).regressed


def test_cells_of_one_side_are_listed(candidate: Callable[[str], Store], swept: Store) -> None:
    found = compare(candidate(""), swept, times=False)
    assert found.compared == 1
    assert [("Candidate" in name) for name in found.only_a] == [True]
    assert len(found.only_b) == len(swept.manifest.cells) - 1


def test_nothing_in_common_is_an_error(candidate: Callable[[str], Store], tmp_path: Path) -> None:
    other = elsewhere(candidate(""), tmp_path / "other")
    manifest = json.loads((other.folder / "manifest.json").read_text())
    manifest["cells"] = []
    (other.folder / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(CompareError, match="cells that both have run, got none"):
        compare(candidate(""), Store(other.folder))


@pytest.mark.parametrize("options", [{"tolerance": -0.1}, {"tolerance": float("nan")}, {"confidence": 1.0}])
def test_numbers_out_of_range_are_named(candidate: Callable[[str], Store], options: dict[str, float]) -> None:
    with pytest.raises(CompareError, match=next(iter(options))):
        compare(candidate(""), candidate(""), **options)
