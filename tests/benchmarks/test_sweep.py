"""Sweeps: what is run and kept, whatever happens meanwhile."""

from __future__ import annotations

import errno
import io
import os
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
import pytest

from kinqp.benchmarks import Cell, Store, StoreError, cells_of, make_config, sweep, sweep_table
from kinqp.benchmarks.begun import from_bytes
from tests.benchmarks.sweeps import CELLS, CLOCKS, HERE, TINY, same_accuracy

if TYPE_CHECKING:
    from collections.abc import Callable

# `position` aside: it follows from q.
COLUMNS = {
    "t", "phase", "q", "qd", "qd_lo", "qd_hi", "v", "eps", "status", "claimed", "iterations", "active", "fixed_error",
    "bound_violation", "sigma_min", "task_scale", "reference_error", *CLOCKS, "message",
}  # fmt: skip


def interrupt_after(parts: int) -> Callable[[int, int, str], None]:
    def on_progress(done: int, total: int, _what: str) -> None:
        assert total == 2 * CELLS
        if done == parts:
            raise KeyboardInterrupt

    return on_progress


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return sweep(TINY, tmp_path_factory.mktemp("whole"), workers=1)


def test_every_cell_is_run_and_stored_with_every_column(whole: Store) -> None:
    manifest = whole.manifest
    assert manifest.config.model_dump() == make_config(dict(TINY)).model_dump()
    assert {"cpu", "cores", "timing", "compiler", "git", "python", "numpy", "date"} <= set(manifest.conditions)
    assert manifest.skipped == {
        "clarabel(tolerance=1e-8) from last active-set": "clarabel(tolerance=1e-8) starts cold only"
    }
    assert len(whole.cells()) == len(manifest.cells) == CELLS
    assert whole.failed() == {}
    for cell in whole.cells():
        ticks, times = whole.ticks(cell), whole.times(cell)
        assert set(ticks.columns) == COLUMNS
        assert len(ticks) == 20
        assert {ticks.schema[name] for name in ("q", "qd", "qd_lo", "qd_hi")} == {pl.Array(pl.Float64, 7)}
        assert {ticks.schema[name] for name in ("v", "eps")} == {pl.List(pl.Float64)}
        assert ticks.schema["active"] == pl.List(pl.String)
        assert all(ticks[name].null_count() == 0 for name in ticks.columns)
        assert times is not None
        assert times.columns == ["tick", "repeat", "wall_setup", "wall_update", "wall_solve", "own", "c"]
        assert set(times["repeat"]) == {0, 1}
        outcome = whole.outcome(cell)
        assert (outcome.accuracy.loop, outcome.accuracy.ticks) == ("closed", 20)
        assert (outcome.timing.ticks, outcome.timing.repeats, outcome.timing.deterministic) == (4, 2, True)
    assert not list(whole.folder.rglob("*.partial"))
    assert len(list((whole.folder / "problems").iterdir())) == 2


def test_the_number_of_workers_does_not_show(whole: Store, tmp_path: Path) -> None:
    same_accuracy(sweep(TINY, tmp_path, workers=2), whole)


@pytest.mark.parametrize("parts", [2, CELLS + 1])
def test_an_interrupted_sweep_is_continued_with_the_rest(whole: Store, tmp_path: Path, parts: int) -> None:
    with pytest.raises(KeyboardInterrupt):
        sweep(TINY, tmp_path, workers=1, on_progress=interrupt_after(parts))
    store = Store(tmp_path)
    kept = {path: path.read_bytes() for name in ("ticks", "times") for path in (tmp_path / name).iterdir()}
    assert min(parts, CELLS) <= len(kept) <= parts + 1
    seen: list[int] = []
    sweep(TINY, tmp_path, resume=True, workers=1, on_progress=lambda done, _total, _what: seen.append(done))
    assert seen[0] == len(kept)
    assert seen[-1] == 2 * CELLS
    for path, content in kept.items():
        assert path.read_bytes() == content
    same_accuracy(store, whole)
    assert store.failed() == {}


def test_a_finished_sweep_is_continued_by_nothing_and_not_overwritten_unasked(whole: Store) -> None:
    before = {path: path.read_bytes() for path in whole.folder.rglob("*.*")}
    sweep(TINY, whole.folder, resume=True)
    assert {path: path.read_bytes() for path in whole.folder.rglob("*.*")} == before
    with pytest.raises(StoreError, match=r"holds a sweep already: give --resume .* --overwrite .* --out"):
        sweep(TINY, whole.folder)
    with pytest.raises(StoreError, match="another configuration"):
        sweep(TINY | {"repeats": 3}, whole.folder, resume=True)
    with pytest.raises(StoreError, match="either --resume or --overwrite"):
        sweep(TINY, whole.folder, resume=True, overwrite=True)


def test_a_full_disk_ends_what_does_not_fit_and_leaves_no_halves(
    whole: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest, calls = os.fsync, iter(range(1000))

    def full(handle: int) -> None:
        if next(calls) in (3, 4, 12):
            raise OSError(errno.ENOSPC, "No space left on device")
        honest(handle)

    monkeypatch.setattr(os, "fsync", full)
    store = sweep(TINY, tmp_path, workers=1)
    assert len(store.unwritten) == 3
    assert all("No space left" in why for why in store.unwritten.values())
    assert not list(tmp_path.rglob("*.partial"))
    for path in tmp_path.rglob("*.parquet"):
        assert len(pl.read_parquet(path)) > 0
    monkeypatch.undo()
    again = sweep(TINY, tmp_path, resume=True, workers=1)
    assert again.unwritten == {}
    assert again.failed() == {}
    same_accuracy(again, whole)
    assert all(again.times(cell) is not None for cell in again.cells())


SLOW = {
    "scenarios": [HERE + "tiny"], "formulations": ["joint-space"], "solvers": [HERE + "Slow", "active-set"],
    "repeats": 40, "timing_ticks": 18, "timing_window": 18, "timing_budget": 1e3,
}  # fmt: skip
SLOW_SWEEP = """
import sys
from kinqp.benchmarks import sweep
from tests.benchmarks.test_sweep import SLOW
sweep(SLOW, sys.argv[1], workers=1)
"""


@pytest.mark.long
def test_a_sweep_killed_while_it_times_goes_on_with_the_visits_that_are_missing(tmp_path: Path) -> None:
    here = str(Path(__file__).parents[2])
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW_SWEEP, str(tmp_path / "out")], cwd=here, env=os.environ | {"PYTHONPATH": here}
    )
    try:
        until = monotonic() + 120.0
        while not list((tmp_path / "out").glob("problems/*.begun")):
            assert process.poll() is None
            assert monotonic() < until
            sleep(0.05)
    finally:
        process.kill()
        process.wait()
    (file,) = (tmp_path / "out").glob("problems/*.begun")
    kept = {name: one.repeats for name, one in from_bytes(file.read_bytes()).items()}
    assert all(repeats >= 5 for repeats in kept.values())
    visits: list[str] = []
    store = sweep(SLOW, tmp_path / "out", resume=True, workers=1,
                  on_progress=lambda _done, _total, what: visits.append(what))  # fmt: skip
    timed = [what for what in visits if what.startswith("timing ")]
    # Each is made ready once, and visited as often as is missing.
    assert len(timed) == 2 + 2 * 40 - sum(kept.values())
    assert not file.exists()
    for cell in store.manifest.cells:
        assert sorted(set(store.times(cell)["repeat"])) == list(range(40))
        assert store.outcome(cell).timing.repeats == 40


def test_a_sweep_measured_elsewhere_is_not_continued(tmp_path: Path) -> None:
    config = TINY | {"formulations": ["joint-space"], "solvers": ["active-set"], "starts": ["cold"]}
    store = sweep(config, tmp_path, workers=1)
    manifest = tmp_path / "manifest.json"
    manifest.write_text(manifest.read_text().replace(store.manifest.conditions["cpu"], "Another CPU"))
    with pytest.raises(StoreError, match="was measured with cpu 'Another CPU'"):
        sweep(config, tmp_path, resume=True)


def test_a_manifest_that_cannot_be_read_says_so(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"expected a sweep's manifest\.json there"):
        _ = Store(tmp_path).manifest
    (tmp_path / "manifest.json").write_text('{"format": 99}')
    with pytest.raises(StoreError, match="expected format 2, got 99"):
        _ = Store(tmp_path).manifest


def test_cells_have_files_of_their_own() -> None:
    names = ("clarabel", "clarabel(tolerance=1e-8)", "clarabel(tolerance=1e-7)", "clarabel_tolerance=1e-7_", "x" * 300)
    stems = {Cell("a", "b", name).file_stem for name in names}
    assert len(stems) == 5
    assert all(len(stem) < 220 and "/" not in stem and "(" not in stem for stem in stems)
    assert str(Cell("a", "b", "c")) == "a / b / c"
    assert str(Cell("a", "b", "c", "active-set")) == "a / b / c from last active-set"
    config = make_config(dict(TINY) | {"more": [{"solvers": ["piqp"]}, dict(TINY) | {"repeats": 2}][:1]})
    assert len(cells_of(config)) == len({cell.file_stem for cell in cells_of(config)}) == CELLS + 2


def test_a_config_written_and_read_again_means_the_same(whole: Store) -> None:
    read = Store(whole.folder).manifest.config
    assert cells_of(make_config(read.model_dump())) == whole.manifest.cells
    assert np.isfinite(read.timing_budget)


def test_the_table_has_a_row_for_every_cell(whole: Store) -> None:
    from rich.console import Console

    from kinqp.benchmarks import TABLE_WIDTH

    console = Console(width=TABLE_WIDTH, record=True, file=io.StringIO())
    console.print(sweep_table(whole))
    text = console.export_text()
    assert text.count("active-set") >= 6
    assert "…" not in text
    assert "watched joints: 4" in text
