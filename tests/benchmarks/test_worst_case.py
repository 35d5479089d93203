"""The search for the worst tick: what it claims is so, again and to the last bit."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from typer.testing import CliRunner

from kinqp.benchmarks.worst_case import Batch, CaseError, WorstCase, read_case, replay, search, write_case
from kinqp.benchmarks.worst_case.states import Draws
from kinqp.benchmarks.worst_case.timing import Stopwatch
from kinqp.cli.app import app
from kinqp.codegen import CompiledStep, compile_step
from kinqp.robots import load_robot

if TYPE_CHECKING:
    from pathlib import Path

TICKS = 60_000


@pytest.fixture(scope="module")
def found(step: CompiledStep) -> WorstCase:
    return search(step, ticks=TICKS, seed=3)


@pytest.fixture(scope="module")
def step() -> CompiledStep:
    return compile_step(load_robot("lbr_med14"), "joint-space", "fix-orientation")


def test_what_is_found_is_so_and_beats_random_states(step: CompiledStep, found: WorstCase) -> None:
    assert sum(found.statuses.values()) == found.ticks == TICKS
    draws = Draws(step, np.random.default_rng(4))
    batch = draws.anywhere(2_000, {})
    random = int(step.batch(batch.q, batch.v).iterations.max())
    assert found.most.iterations > random >= 1
    result = step(found.most.q, found.most.v, **{name: np.array(x) for name, x in found.most.limits.items()})
    assert result.iterations == found.most.iterations
    assert found.slowest.seconds >= found.median > 0.0


def test_the_same_seed_finds_the_same_state(step: CompiledStep, found: WorstCase) -> None:
    first, second = found.most, search(step, ticks=TICKS, seed=3).most
    assert (first.q, first.v, first.limits, first.iterations) == (second.q, second.v, second.limits, second.iterations)


def test_an_interrupted_search_keeps_what_it_has(step: CompiledStep) -> None:
    def stop(done: int, *_: int) -> None:
        if done >= 20_000:
            raise KeyboardInterrupt

    cut = search(step, ticks=TICKS, seed=3, on_progress=stop)
    assert cut.ticks == 20_000
    assert cut.most.iterations >= 1


def test_what_is_found_is_handed_over_before_it_is_timed_and_timing_may_be_ended(
    step: CompiledStep, found: WorstCase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    early: list[WorstCase] = []
    monkeypatch.setattr(Stopwatch, "seconds", interrupted)
    cut = search(step, ticks=TICKS, seed=3, on_found=early.append)
    assert early == [cut]
    assert (cut.most.q, cut.most.iterations, cut.ticks) == (found.most.q, found.most.iterations, TICKS)
    assert (cut.median, cut.most.seconds, cut.slowest) == (None, None, cut.most)
    write_case(cut, tmp_path / "case.json")
    assert read_case(tmp_path / "case.json") == cut


def test_ctrl_c_while_timing_leaves_the_search_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "worst.json"
    seen: list[WorstCase] = []

    def interrupted(*_: object) -> None:
        seen.append(read_case(out))
        raise KeyboardInterrupt

    monkeypatch.setattr(Stopwatch, "seconds", interrupted)
    words = ["worst-case", "--robot", "lbr_med14", "--formulation", "joint-space", "--ticks", "20000"]
    done = CliRunner().invoke(app, [*words, "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "Interrupted before ticks were timed" in done.output
    assert [case.most.iterations for case in seen] == [read_case(out).most.iterations]
    assert (seen[0].robot, seen[0].formulation) == ("lbr_med14", "joint-space")


def test_a_case_is_shown_again_from_its_file(found: WorstCase, tmp_path: Path) -> None:
    write_case(found, tmp_path / "case.json")
    case = read_case(tmp_path / "case.json")
    assert case == found
    again = replay(case)
    assert (again.most.iterations, again.most.active) == (found.most.iterations, found.most.active)
    assert (again.slowest.iterations, again.slowest.q) == (found.slowest.iterations, found.slowest.q)


def test_a_slower_tick_is_timed_as_slower(step: CompiledStep, found: WorstCase) -> None:
    q = np.array([[0.0, 0.7, 0.0, -1.6, 0.0, 0.4, 0.0]])
    easy = Batch(q, np.array([[0.01, 0.0, 0.0]]), np.zeros((1, 7)), np.full((1, 7), np.inf))
    assert step(q[0], easy.v[0]).iterations == 0
    fast, slow = Stopwatch(step, 0).seconds([easy, found.most.state()])
    assert slow > fast


def test_states_stay_within_the_limits_drawn(step: CompiledStep) -> None:
    draws = Draws(step, np.random.default_rng(0))
    limits = next(limits for limits in iter(draws.limits, None) if limits)
    for batch in (draws.anywhere(500, limits), draws.near(draws.anywhere(1, limits), 500)):
        assert np.isfinite(batch.q).all()
        assert np.isfinite(batch.v).all()
        assert (np.abs(batch.qd_prev) <= limits["qd_max"]).all()
    inside = draws.anywhere(2_000, limits).q
    assert np.mean((inside >= limits["q_min"]) & (inside <= limits["q_max"])) > 0.9
    assert (inside > limits["q_max"]).any()
    assert (inside == limits["q_max"]).any()


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"kind": "another"}', '{"kind": "kinqp worst case"}'])
def test_what_is_no_case_is_named(text: str, tmp_path: Path) -> None:
    path = tmp_path / "no.json"
    path.write_text(text)
    with pytest.raises(CaseError, match=r"no\.json: expected a file that kinqp worst-case has written"):
        read_case(path)


def test_on_the_command_line(tmp_path: Path) -> None:
    runner, out = CliRunner(), tmp_path / "worst.json"
    words = [
        "worst-case",
        "--robot",
        "lbr_med14",
        "--formulation",
        "joint-space",
        "--ticks",
        "30000",
        "--out",
        str(out),
    ]
    done = runner.invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "most iterations" in done.output
    assert str(out) in done.output
    again = runner.invoke(app, ["worst-case", "--replay", str(out)])
    assert again.exit_code == 0, again.output
    assert "Iterations and status are the same" in again.output
    given = json.loads(out.read_text())
    given["most"]["iterations"] += 1
    out.write_text(json.dumps(given))
    assert runner.invoke(app, ["worst-case", "--replay", str(out)]).exit_code == 1


def test_what_is_missing_is_named() -> None:
    with pytest.raises(CaseError, match="expected --robot and --formulation"):
        CliRunner().invoke(app, ["worst-case"], catch_exceptions=False)
    with pytest.raises(ValueError, match="ticks: expected at least 1, got 0"):
        search(compile_step(load_robot("lbr_med14"), "joint-space", "fix-orientation"), ticks=0)
