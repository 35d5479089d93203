"""The check of the invariants as it is run: blocks, solvers that lie, results kept and resumed, the command line."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest
from typer.testing import CliRunner

from kinqp.benchmarks.invariants import Block, InvariantsError, arm, read_rows, run, run_block, to_markdown
from kinqp.benchmarks.invariants.__main__ import make_blocks
from kinqp.robots import RobotError
from kinqp.solvers import QP, RawSolution, Solver, Status, get_solver
from tests.benchmarks.judged import MODE

if TYPE_CHECKING:
    from pathlib import Path


class Liar(Solver):
    """Says "solved" of a point that is none: the right one, moved."""

    name = "liar"

    def __init__(self) -> None:
        super().__init__(tolerance=1e-9)
        self.honest = get_solver("active-set")

    def _setup(self, qp: QP) -> None:
        pass

    def _update(self, qp: QP) -> None:
        pass

    def _solve(self, qp: QP) -> RawSolution:
        right = self.honest.solve(qp)
        x = right.x + 0.01 * np.random.default_rng(qp.n).normal(size=qp.n)
        return RawSolution(claimed=Status.SOLVED, x=x, y=right.y, z=right.z, z_box=right.z_box)


def test_a_solver_that_lies_is_counted_and_caught() -> None:
    counts = (("active-set", 16), ("tests.benchmarks.test_invariants:Liar", 16))
    honest, liar = run_block(Block("joint-space", "lbr_med14", MODE, counts))
    assert honest.wrong_solved == 0
    assert not honest.violations
    assert liar.wrong_solved == 16
    assert liar.refused == {"inaccurate": 16}
    assert not liar.violations  # the step refuses all of it, and stops


def test_a_block_with_everything_in_it() -> None:
    counts = (("active-set", 8), ("clarabel", 8), ("piqp", 8), ("cvxpy", 5))
    rows = run_block(Block("cartesian-error-robust", "panda", "line:z", counts))
    assert [row.solver for row in rows] == ["active-set", "clarabel", "piqp", "cvxpy"]
    for each in rows:
        assert not each.violations
        assert each.states == dict(counts)[each.solver]
        assert {"finite", "bounds", "locked rows", "safe stop", "residuals", "cost", "nan"} <= set(each.checked)
    assert {"cvxpy numbers", "cvxpy answer"} <= set(rows[-1].checked)


def test_what_can_not_be_says_why() -> None:
    counts = (("active-set", 2),)
    (made,) = run_block(Block("joint-space + elbow-range", "ur5e", "free", counts))
    assert made.skipped
    assert made.states == 0
    assert made.skipped in to_markdown([made])
    with pytest.raises(RobotError, match="known name"):
        arm("pandora")


def test_results_are_kept_and_resumed(tmp_path: Path) -> None:
    counts = (("active-set", 3),)
    blocks = [Block("joint-space", "lbr_med14", mode, counts) for mode in ("free", MODE)]
    seen: list[tuple[int, int, str]] = []
    run(blocks[:1], tmp_path, on_progress=lambda *args: seen.append(args))
    first = next((tmp_path / "blocks").glob("*.json"))
    stamp = first.stat().st_mtime_ns
    with pytest.raises(InvariantsError, match="--resume"):
        run(blocks, tmp_path)
    rows = run(blocks, tmp_path, resume=True, on_progress=lambda *args: seen.append(args))
    assert first.stat().st_mtime_ns == stamp
    assert [row.mode for row in rows] == [MODE, "free"]
    assert [done for done, _, _ in seen] == [1, 2]
    assert read_rows(tmp_path) == rows
    with pytest.raises(InvariantsError, match="seed"):
        run([dataclasses.replace(blocks[0], seed=1)], tmp_path, resume=True)
    assert not list(tmp_path.rglob("*.partial"))


def test_blocks_cover_what_is_asked_for() -> None:
    counts = {"active-set": 100}
    blocks = make_blocks(None, ["ur5e"], None, counts, 10, 7)
    names = {block.formulation for block in blocks}
    assert {"joint-space", "hierarchical", "minimum-torque-norm"} <= names
    assert all(block.seed == 7 for block in blocks)
    assert {dict(block.counts)["active-set"] for block in blocks if "+" in block.formulation} == {10}
    assert len([block for block in blocks if block.formulation == "joint-space"]) == 7


def test_command_line(tmp_path: Path) -> None:
    import typer

    from kinqp.benchmarks.invariants.__main__ import main

    app = typer.Typer()
    app.command()(main)
    chosen = ["--formulation", "joint-space", "--robot", "lbr_med14", "--mode", "free", "--out", str(tmp_path / "r")]
    good = CliRunner().invoke(app, [*chosen, "--solver", "active-set=4", "--solver", "piqp", "--states", "2"])
    assert good.exit_code == 0, good.output
    assert "| joint-space | piqp | 1 | 2 |" in good.output
    assert (tmp_path / "r" / "table.md").read_text().startswith("## Formulation by solver")
    again = CliRunner().invoke(app, [*chosen, "--solver", "active-set=4"])
    assert again.exit_code == 1
