"""Records that are kept: the same as new ones, and only as long as nothing they follow from has changed."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from kinqp.benchmarks import Store, make_config, records, sweep
from kinqp.benchmarks.accuracy import PreparedBlock
from kinqp.benchmarks.metrics import kept
from kinqp.benchmarks.store import parquet

from .tiny import HERE_TINY

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def store(tmp_path: Path) -> Store:
    config = make_config(
        {"scenarios": ["infeasible", HERE_TINY], "formulations": ["damped"], "solvers": ["active-set"]}
    )
    made = Store(tmp_path)
    made.begin(config, {}, resume=False, overwrite=False)
    for cell in made.manifest.cells:
        ticks, part = PreparedBlock(cell.block, config).run(cell)
        made.add_accuracy(cell, parquet(ticks), part)
    return made


def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    made: list[str] = []
    honest = kept.cell_record

    def noted(*args: object, **names: object) -> object:
        made.append(args[2].name)
        return honest(*args, **names)

    monkeypatch.setattr(kept, "cell_record", noted)
    return made


def test_a_second_time_they_are_the_same_and_not_made(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    made = counted(monkeypatch)
    first = records(store)
    assert made == ["infeasible", "tiny"]
    again = records(Store(store.folder))
    # What somebody else's scenario is made of can't be told from its file.
    assert made == ["infeasible", "tiny", "tiny"]
    assert again.equals(first, null_equal=True)
    assert again.schema == first.schema


def test_what_has_changed_is_made_anew(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    made = counted(monkeypatch)
    first = records(store)
    cell = store.manifest.cells[0]
    store.add_accuracy(cell, parquet(store.ticks(cell).head(150)), store.outcome(cell).accuracy)
    changed = records(store)
    assert made.count("infeasible") == 2
    assert (first["ticks"][0], changed["ticks"][0]) == (300, 150)
    monkeypatch.setattr(kept, "_library", lambda: b"another version")
    records(store)
    assert made.count("infeasible") == 3
    store.record(cell).write_text("{")
    records(store)
    assert made.count("infeasible") == 4


def test_a_folder_that_can_not_be_written_to_can_be_read(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kept, "write_whole", full)
    assert len(records(store)) == 2
    assert not list((store.folder / "records").iterdir())


def test_another_sweep_in_the_folder_begins_without_them(store: Store) -> None:
    records(store)
    (file,) = (store.folder / "records").iterdir()
    assert json.loads(file.read_text())["record"]["scenario"] == "infeasible"
    sweep({"scenarios": [HERE_TINY], "formulations": ["damped"], "solvers": ["active-set"], "repeats": 1},
          store.folder, overwrite=True, workers=1)  # fmt: skip
    assert not list((store.folder / "records").iterdir())
