"""Sweeps in which something fails: solvers that crash, hang or eat all memory, broken blocks, full disks."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from kinqp.benchmarks import sweep
from tests.benchmarks.sweeps import CELLS, HERE, TINY


def test_solvers_that_crash_hang_or_are_mistaken_end_their_cells_alone(tmp_path: Path) -> None:
    solvers = [HERE + name for name in ("Crashing", "CrashingLate", "Hanging", "Mistaken")]
    config = TINY | {
        "formulations": ["joint-space"], "solvers": [*solvers, "active-set"], "starts": ["cold"], "cell_timeout": 2.0,
        "timing_ticks": 18, "timing_window": 18,
    }  # fmt: skip
    store = sweep(config, tmp_path, workers=2)
    crashing, late, hanging, mistaken, honest = store.manifest.cells
    assert store.failed() == {
        crashing: "the process was ended by SIGSEGV",
        late: "the process was ended by SIGSEGV",
        hanging: "the process took longer than 2 s and was stopped",
        mistaken: "KeyError: 'no such row'",
    }
    assert store.cells() == (late, honest)
    assert store.outcome(late).accuracy.state == "done"
    assert store.times(late) is None
    assert store.times(honest) is not None
    assert (store.ticks(honest)["status"] == "solved").all()


def test_solvers_that_eat_all_memory_end_their_cells_alone(tmp_path: Path) -> None:
    names = ("Hungry", "HungryInC", "HungryLate", "Killed")
    config = TINY | {
        "formulations": ["joint-space"], "solvers": [*(HERE + name for name in names), "active-set"],
        "starts": ["cold"], "timing_ticks": 18, "timing_window": 18,
    }  # fmt: skip
    store = sweep(config, tmp_path, workers=1)
    hungry, in_c, late, killed, honest = store.manifest.cells
    failed = store.failed()
    assert set(failed) == {hungry, in_c, late, killed}
    assert "MemoryError: Unable to allocate" in failed[hungry]
    assert failed[in_c] == "the process was ended by SIGSEGV"
    assert "MemoryError: Unable to allocate" in failed[late]
    assert failed[killed] == "the process was ended by SIGKILL, as when memory runs out"
    assert store.cells() == (late, honest)
    assert store.outcome(late).accuracy.state == "done"
    assert store.times(late) is None
    assert store.times(honest) is not None
    assert (store.ticks(honest)["status"] == "solved").all()


def test_a_block_that_cannot_be_begun_ends_its_cells_alone(tmp_path: Path) -> None:
    config = TINY | {
        "scenarios": [HERE + "unknown_input", HERE + "tiny"],
        "formulations": ["joint-space"],
        "solvers": ["active-set"],
        "starts": ["cold"],
    }
    store = sweep(config, tmp_path, workers=1)
    lost, kept = store.manifest.cells
    assert store.cells() == (kept,)
    assert "the scenario gives wind" in store.failed()[lost]


# A file system of its own, too small for the sweep; then the same one, larger.
SMALL_DISK = """
set -e
mount -t tmpfs -o size=64k none "$1"
"$2" "$3" "$1" first
mount -o remount,size=64m "$1"
"$2" "$3" "$1" second
"""
SWEEP_IT = """
import json, sys
from pathlib import Path
from kinqp.benchmarks import sweep
from tests.benchmarks.sweeps import TINY
out = Path(sys.argv[1])
store = sweep(TINY, out, resume=sys.argv[2] == "second", workers=1)
print(json.dumps({
    "unwritten": store.unwritten, "failed": len(store.failed()), "cells": len(store.cells()),
    "timed": sum(store.times(cell) is not None for cell in store.cells()),
    "partial": len(list(out.rglob("*.partial"))), "read": sum(len(store.ticks(cell)) for cell in store.cells()),
}))
"""


def own_mounts() -> str:
    """Say why there can be no file system of one's own here; empty where there can."""
    tool = shutil.which("unshare")
    if tool is None or shutil.which("mount") is None:
        return "no unshare, or no mount"
    asked = subprocess.run([tool, "-rm", "true"], check=False, capture_output=True, text=True)
    return asked.stderr.strip()


@pytest.mark.long
@pytest.mark.skipif(bool(own_mounts()), reason=own_mounts() or "there can be one")
def test_a_disk_that_is_really_full_ends_what_does_not_fit(tmp_path: Path) -> None:
    script = tmp_path / "sweep_it.py"
    script.write_text(SWEEP_IT)
    (tmp_path / "disk").mkdir()
    here = str(Path(__file__).parents[2])
    done = subprocess.run(
        [str(shutil.which("unshare")), "-rm", "sh", "-c", SMALL_DISK, "sh", tmp_path / "disk", sys.executable, script],
        check=False, capture_output=True, text=True, cwd=here, env=os.environ | {"PYTHONPATH": here},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    first, second = (json.loads(line) for line in done.stdout.splitlines())
    assert len(first["unwritten"]) > 0
    assert all("No space left on device" in why for why in first["unwritten"].values())
    assert 0 < first["cells"] < CELLS or first["timed"] < CELLS
    assert first["read"] == 20 * first["cells"]
    assert second == {"unwritten": {}, "failed": 0, "cells": CELLS, "timed": CELLS, "partial": 0, "read": 20 * CELLS}
    assert first["partial"] == 0
