"""Sweeps: what is run, in which order, what is kept."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from numpy.typing import ArrayLike

from kinqp.benchmarks import Cell, Store, StoreError, SweepConfig, cells_of, make_config, sweep
from kinqp.control import InterpretedStep
from kinqp.formulations import StepResult

TINY = {
    "scenarios": ["tests.benchmarks.tiny:tiny"],
    "formulations": ["cartesian-error", "joint-space"],
    "solvers": ["thesis-active-set", "clarabel(tolerance=1e-8)"],
    "repeats": 3,
    "warm_up": 2,
}


def stop_after(runs: int) -> Callable[[int, int, str], None]:
    def on_progress(done: int, total: int, cell: str) -> None:
        assert total == 12
        assert cell or done == total
        if done == runs:
            raise KeyboardInterrupt

    return on_progress


def test_every_cell_is_run_and_stored_with_every_column(tmp_path: Path) -> None:
    store = sweep(TINY, tmp_path / "out")
    config, conditions = store.manifest()
    assert config == make_config(dict(TINY))
    assert {"cpu", "cores", "python", "numpy", "clarabel", "piqp", "date"} <= set(conditions)
    assert len(cells_of(config)) == 4
    for cell in cells_of(config):
        frame = store.read(cell)
        assert len(frame) == 20
        assert store.repeats_done(cell) == 3
        for name, width in (("q", 7), ("qd", 7), ("v", 3), ("eps", 3), ("position", 3)):
            assert frame[name].to_numpy().shape == (20, width)
        for name in ("setup_time", "solve_time"):
            times = frame[name].to_numpy()
            assert times.shape == (20, 3)
            assert (times > 0.0).all()
        assert set(frame["status"]) == {"solved"}
        assert frame.schema["active"] == pl.List(pl.String)
        np.testing.assert_allclose(frame["t"].to_numpy(), 1e-3 * np.arange(20))
        for name in ("fixed_error", "bound_violation", "sigma_min", "iterations", "message"):
            assert frame[name].null_count() == 0
    assert not list((tmp_path / "out").rglob("*.partial"))


def test_interrupted_sweep_keeps_its_runs_and_resumes_with_the_rest(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        sweep(TINY, tmp_path, on_progress=stop_after(7))
    store = Store(tmp_path)
    cells = cells_of(store.manifest()[0])
    assert sum(store.repeats_done(cell) for cell in cells) == 7
    kept = {cell: store.read(cell)["solve_time"].to_numpy() for cell in cells}
    seen: list[int] = []
    sweep(TINY, tmp_path, resume=True, on_progress=lambda done, _total, _cell: seen.append(done))
    assert seen == [7, 8, 9, 10, 11, 12]
    for cell in cells:
        times = store.read(cell)["solve_time"].to_numpy()
        assert times.shape == (20, 3)
        np.testing.assert_array_equal(times[:, : kept[cell].shape[1]], kept[cell])


def test_a_finished_sweep_resumes_to_nothing(tmp_path: Path) -> None:
    sweep(TINY | {"repeats": 1}, tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.parquet")}
    sweep(TINY | {"repeats": 1}, tmp_path, resume=True)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.parquet")} == before


def test_a_folder_with_a_sweep_is_not_overwritten_unasked(tmp_path: Path) -> None:
    sweep(TINY | {"repeats": 1}, tmp_path)
    with pytest.raises(StoreError, match=r"holds a sweep already: give --resume .* --overwrite .* --out"):
        sweep(TINY | {"repeats": 1}, tmp_path)
    with pytest.raises(StoreError, match="another configuration"):
        sweep(TINY | {"repeats": 2}, tmp_path, resume=True)
    one = TINY | {"repeats": 1, "solvers": ["piqp"]}
    store = sweep(one, tmp_path, overwrite=True)
    assert sorted(path.stem for path in (tmp_path / "cells").iterdir()) == sorted(
        Path(cell.file_name).stem for cell in cells_of(store.manifest()[0])
    )


def test_a_sweep_measured_elsewhere_is_not_continued(tmp_path: Path) -> None:
    sweep(TINY | {"repeats": 1}, tmp_path)
    manifest = tmp_path / "manifest.json"
    text = manifest.read_text()
    cpu = Store(tmp_path).manifest()[1]["cpu"]
    manifest.write_text(text.replace(cpu, "Another CPU"))
    with pytest.raises(StoreError, match="was measured with cpu 'Another CPU'"):
        sweep(TINY | {"repeats": 1}, tmp_path, resume=True)


def test_the_order_is_shuffled_anew_in_every_repeat_and_by_seed(tmp_path: Path) -> None:
    def order(seed: int, out: Path) -> list[list[str]]:
        cells: list[str] = []
        sweep(TINY | {"seed": seed}, out, on_progress=lambda _done, _total, cell: cells.append(cell))
        return [cells[i : i + 4] for i in (0, 4, 8)]

    first, again, other = order(0, tmp_path / "a"), order(0, tmp_path / "b"), order(1, tmp_path / "c")
    assert first == again
    assert first != other
    assert all(sorted(repeat) == sorted(first[0]) for repeat in first)
    assert first[0] != first[1] or first[1] != first[2]


def test_a_controller_that_is_not_deterministic_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = iter(range(10_000))
    honest = InterpretedStep.__call__

    def drifting(self: InterpretedStep, q: ArrayLike, v: ArrayLike, **inputs: ArrayLike) -> StepResult:
        return honest(self, q, np.asarray(v) * (1.0 + 1e-9 * next(calls)), **inputs)

    monkeypatch.setattr(InterpretedStep, "__call__", drifting)
    with pytest.raises(StoreError, match="expected the same commands in every run"):
        sweep(TINY, tmp_path)


def test_a_manifest_that_cannot_be_read_says_so(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"expected a sweep's manifest\.json there"):
        Store(tmp_path).manifest()
    (tmp_path / "manifest.json").write_text('{"format": 99}')
    with pytest.raises(StoreError, match="expected format 1, got 99"):
        Store(tmp_path).manifest()


def test_cells_have_files_of_their_own() -> None:
    config = SweepConfig(solvers=("clarabel", "clarabel(tolerance=1e-8)", "clarabel(tolerance=1e-7)"))
    names = {cell.file_name for cell in cells_of(config)}
    assert len(names) == len(cells_of(config)) == 6
    assert all("/" not in name and "(" not in name for name in names)
    assert str(Cell("a", "b", "c")) == "a / b / c"
