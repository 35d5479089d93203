"""Running blocks, by several processes if wanted, and keeping what is done."""

from __future__ import annotations

import hashlib
import json
import re
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TYPE_CHECKING, Any, Final

from ..conditions import conditions
from ..store import write_whole
from .blocks import Block, run_block
from .tally import Row

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

_MANIFEST: Final = "manifest.json"


class InvariantsError(ValueError):
    """The results folder can't be used as asked; the message says what to do."""


def run(
    blocks: Sequence[Block],
    out: Path,
    *,
    workers: int = 1,
    resume: bool = False,
    on_progress: Callable[[int, int, str], None] | None = None,
) -> list[Row]:
    """Check all blocks; each leaves one file with its rows, there whole or not at all.

    Parameters
    ----------
    blocks : sequence of Block
    out : Path
        Results folder, made where it is missing.
    workers : int
        Processes; 1 stays in this one.
    resume : bool
        Keep the blocks that the folder holds.
    on_progress : callable, optional
        Called with (blocks done, blocks in all, the block just done).

    Returns
    -------
    list of Row

    Raises
    ------
    InvariantsError
        When the folder holds results and `resume` is not asked for, or holds those of another seed or of other counts.
    """
    _begin(blocks, out, resume=resume)
    pending = [block for block in blocks if not _path(out, block).exists()]
    done = len(blocks) - len(pending)

    def keep(block: Block, rows: list[Row]) -> None:
        nonlocal done
        content = json.dumps([row.model_dump(mode="json") for row in rows], indent=1) + "\n"
        write_whole(_path(out, block), content.encode())
        done += 1
        if on_progress is not None:
            on_progress(done, len(blocks), f"{block.formulation}, {block.robot}, {block.mode}")

    if workers == 1:
        for block in pending:
            keep(block, run_block(block))
    else:
        with ProcessPoolExecutor(workers) as pool:
            jobs = {pool.submit(run_block, block): block for block in pending}
            try:
                for job in as_completed(jobs):
                    keep(jobs[job], job.result())
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    return read_rows(out)


def read_rows(out: Path) -> list[Row]:
    """Rows of all blocks in a results folder, sorted.

    Raises
    ------
    InvariantsError
        When there are none.
    """
    files = sorted((out / "blocks").glob("*.json"))
    if not files:
        raise InvariantsError(f"{out}: expected a folder with results of a run, got none")
    rows = [Row.model_validate(each) for file in files for each in json.loads(file.read_text(encoding="utf-8"))]
    return sorted(rows, key=lambda row: (row.formulation, row.solver, row.robot, row.mode))


def _begin(blocks: Sequence[Block], out: Path, *, resume: bool) -> None:
    manifest = out / _MANIFEST
    if manifest.exists() and not resume:
        raise InvariantsError(f"{out} holds results already: give --resume to continue, or another folder with --out")
    wanted: dict[str, Any] = {"seed": sorted({block.seed for block in blocks})}
    wanted["counts"] = sorted({json.dumps(dict(block.counts), sort_keys=True) for block in blocks})
    if manifest.exists():
        stored = json.loads(manifest.read_text(encoding="utf-8"))
        for name, value in wanted.items():
            if stored[name] != value:
                raise InvariantsError(f"{out} was run with {name} {stored[name]}, and this is {value}: give the same")
        return
    (out / "blocks").mkdir(parents=True, exist_ok=True)
    content = json.dumps({**wanted, "conditions": conditions()}, indent=1) + "\n"
    write_whole(manifest, content.encode())


def _path(out: Path, block: Block) -> Path:
    text = f"{block.formulation}__{block.robot}__{block.mode}"
    # Two names may become one in a file name; what tells them apart is kept in the hash.
    key = hashlib.sha256(text.encode()).hexdigest()[:8]
    return out / "blocks" / f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', text)[:120]}-{key}.json"
