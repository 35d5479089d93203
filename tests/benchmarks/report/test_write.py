"""What a report writes, and from what."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks import ReportError, Store, StoreError, get_scenario
from kinqp.benchmarks.report import Selection, write_report
from kinqp.benchmarks.report.envelope import envelope
from kinqp.benchmarks.report.page import buckets_for
from kinqp.benchmarks.report.series import samples
from kinqp.benchmarks.report.traces import packed, rounded

if TYPE_CHECKING:
    from pathlib import Path

TINY = "tests.benchmarks.tiny:"


def test_the_paper_gets_every_figure_twice(swept: Store) -> None:
    chosen = Selection((TINY + "tiny",), ("joint-space",), ("active-set", "clarabel"))
    written = write_report(swept, selection=chosen)
    plain = "tests.benchmarks.tiny_tiny-"
    stems = {path.stem.removeprefix(plain) for path in written.figures}
    assert stems == {
        "iterations", "cdf", "time-wall", "time-wall-p95", "time-own", "time-own-p95", "time-c", "time-c-p95",
        "singularities", "joint-limits", "performance-profile", "scorecard",
    }  # fmt: skip
    assert len(written.figures) == 2 * len(stems)
    for path in written.figures:
        head = path.read_bytes()[:8]
        assert head.startswith(b"\x89PNG" if path.suffix == ".png" else b"<?xml"), path
    names = (swept.folder / "report" / "figures" / f"{plain}iterations.svg").read_text()
    assert names.count("<path") > 4
    assert written.page.stat().st_size < 7e6


def test_the_same_sweep_gives_the_same_page(swept: Store) -> None:
    first = write_report(swept, figures=False).page.read_bytes()
    assert write_report(swept, figures=False).page.read_bytes() == first


@pytest.mark.parametrize(
    ("chosen", "named"),
    [
        (Selection(scenarios=("nowhere",)), "scenario: expected one of the sweep's .*'nowhere'"),
        (Selection(formulations=("cartesian",)), "formulation: .*joint-space.*'cartesian'"),
        (Selection(solvers=("magic",)), "solver: .*clarabel.*'magic'"),
        (Selection(start="warm"), "start: .*cold.*'warm'"),
    ],
)
def test_what_is_not_in_the_sweep_is_named(swept: Store, chosen: Selection, named: str) -> None:
    with pytest.raises(ReportError, match=named):
        write_report(swept, selection=chosen)


def test_no_sweep_and_a_sweep_not_begun_are_said_to_be_so(swept: Store, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"manifest\.json"):
        write_report(Store(tmp_path))
    (tmp_path / "manifest.json").write_text((swept.folder / "manifest.json").read_text())
    with pytest.raises(ReportError, match="at least one cell run, got none"):
        write_report(Store(tmp_path))


def test_a_name_can_not_end_the_script_that_it_lies_in(swept: Store, tmp_path: Path) -> None:
    import shutil

    folder = tmp_path / "hostile"
    shutil.copytree(swept.folder, folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["conditions"]["cpu"] = "<script>alert(1)</script>"
    manifest["cells"][0]["solver"] = "</script><script>alert(2)</script>"
    (folder / "manifest.json").write_text(json.dumps(manifest))
    html = write_report(Store(folder), figures=False).page.read_text()
    assert "<script>alert" not in html
    assert "&lt;script&gt;alert(1)" in html


def test_pages_of_thousands_of_cells_stay_small() -> None:
    assert buckets_for(10) == buckets_for(1000) == 300
    # What a bucket costs is measured in docs/report.md; here only that there is a limit at all.
    assert buckets_for(5000) < buckets_for(2000) < 300
    assert buckets_for(100_000) >= 60


def times() -> pl.DataFrame:
    rows = {
        "tick": [5, 0, 5, 6, 6], "repeat": [0, 0, 1, 0, 1], "wall_update": [1e-6, None, 2e-6, 3e-6, 4e-6],
        "wall_solve": [1e-5, 9e-1, 2e-5, 3e-5, 4e-5], "own": [1e-7, 9e-1, None, 3e-7, 4e-7], "c": [None] * 5,
    }  # fmt: skip
    return pl.DataFrame(rows, schema_overrides={"c": pl.Float64})


def test_samples_by_clock_without_set_ups() -> None:
    wall = samples(times(), "wall")
    assert wall.tick.tolist() == [5, 5, 6, 6]
    assert wall.seconds == pytest.approx([1.1e-5, 2.2e-5, 3.3e-5, 4.4e-5])
    assert samples(times(), "own").seconds == pytest.approx([1e-7, 3e-7, 4e-7])
    assert samples(times(), "c").seconds.size == 0
    with pytest.raises(ValueError, match="clock: expected one of wall, own, c, got 'cpu'"):
        samples(times(), "cpu")


def test_the_cut_leaves_out_the_slowest_twentieth() -> None:
    rng = np.random.default_rng(0)
    seconds = rng.permutation(np.arange(1.0, 101.0))
    frame = pl.DataFrame({"tick": np.arange(100), "wall_update": np.zeros(100), "wall_solve": seconds})
    cut = samples(frame, "wall").cut()
    assert sorted(cut.seconds) == list(range(1, 96))


def test_the_envelope_is_that_of_the_thesis() -> None:
    """Equation 4.11 by hand: 75 deg/s and 10 rad/s^2 at the elbow of the LBR Med 14, limits at 120 deg."""
    area = envelope(get_scenario("semicircle"), 3)
    assert area is not None
    assert area.unit == "deg"
    assert (area.q[0], area.q[-1]) == pytest.approx((-120.0, 120.0))
    low, high = area.bounds["thesis"]
    ahead = np.deg2rad(120.0 - area.q)
    expected = np.minimum(np.minimum(ahead / 1e-3, np.deg2rad(75.0)), np.sqrt(2 * 10.0 * np.maximum(ahead, 0.0)))
    assert np.deg2rad(high) == pytest.approx(expected, abs=1e-9)
    assert low == pytest.approx(-high[::-1], abs=1e-7)
    _, viable = area.bounds["viable"]
    assert np.all(viable <= high + 1e-9), "in sampled time one has to brake earlier"
    assert np.any(viable < high - 0.1)


def test_numbers_are_rounded_and_gaps_are_null() -> None:
    assert rounded([1.23456789, np.nan, np.inf, 0.0, -1e-9]) == [1.235, None, None, 0.0, -1e-9]
    assert packed({"a": [1]}) == packed({"a": [1]})
