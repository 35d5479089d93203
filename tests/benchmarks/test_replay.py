"""The timing part: which problems, in which order, and that C solves the same ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinqp.benchmarks import Block, Cell, SweepConfig
from kinqp.benchmarks.accuracy import PreparedBlock
from kinqp.benchmarks.begun import Progress, from_bytes, to_bytes
from kinqp.benchmarks.problems import Problems, choose_windows, ticks_of
from kinqp.benchmarks.replay import TimedCell, time_block
from kinqp.benchmarks.timing_c import c_replay
from kinqp.solvers import get_solver

if TYPE_CHECKING:
    from collections.abc import Callable

HERE = "tests.benchmarks.tiny:"
CONFIG = SweepConfig(repeats=3, timing_ticks=12, timing_window=4)


def problems(scenario: str, formulation: str = "joint-space-robust") -> Problems:
    return PreparedBlock(Block(HERE + scenario, formulation), CONFIG).problems


@given(ticks=st.integers(1, 300), wanted=st.integers(1, 100), length=st.integers(1, 40), seed=st.integers(0, 9))
def test_windows_lie_in_the_run_and_do_not_overlap(ticks: int, wanted: int, length: int, seed: int) -> None:
    windows = choose_windows(ticks, wanted, length, seed)
    assert windows
    timed = [tick for window in windows for tick in window.ticks]
    assert len(timed) == len(set(timed)) <= max(wanted, 1)
    assert 0 <= min(ticks_of(windows)) <= max(ticks_of(windows)) < ticks
    for window in windows:
        if ticks > 1:
            assert window.ticks == tuple(range(window.lead + 1, window.lead + 1 + len(window.ticks)))


def test_windows_by_hand() -> None:
    windows = choose_windows(101, 40, 20, seed=0)
    assert sorted((w.lead, w.ticks[0], w.ticks[-1]) for w in windows) == [(0, 1, 20), (80, 81, 100)]
    assert len(choose_windows(1, 5, 5, 0)) == 1


@pytest.mark.parametrize("formulation", ["joint-space-robust", "hierarchical"])
@pytest.mark.parametrize("scenario", ["tiny", "two_phases"])
def test_problems_survive_being_written(scenario: str, formulation: str) -> None:
    recorded = problems(scenario, formulation)
    read = Problems.from_bytes(recorded.to_bytes())
    assert read.windows == recorded.windows
    assert list(read.qps) == list(recorded.qps)
    for tick, qps in recorded.qps.items():
        assert len(qps) == len(read.qps[tick]) == (1 if formulation == "joint-space-robust" else 2)
        for a, b in zip(qps, read.qps[tick], strict=True):
            assert a.structure == b.structure
            for name in ("H", "g", "A", "b", "C", "l", "u", "lb", "ub"):
                np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
            np.testing.assert_equal(a.x_feasible, b.x_feasible)


@pytest.mark.parametrize(("solver", "start"), [("active-set", "active-set"), ("casadi-qrqp", "solution")])
@pytest.mark.parametrize("scenario", ["tiny", "two_phases"])
def test_c_solves_the_same_problems(scenario: str, solver: str, start: str) -> None:
    recorded = problems(scenario)
    qps = [qp for levels in recorded.qps.values() for qp in levels]
    for options in ({}, get_solver(solver).starts[start]):
        made = get_solver(solver, **options)
        replay = c_replay(made)
        assert replay is not None
        fresh = [index % 5 == 0 for index in range(len(qps))]
        seconds = replay.seconds(qps, fresh)
        assert (seconds > 0.0).all()
        assert (seconds < 0.1).all()
        seen = 0
        for places, status, answers in replay.answers():
            assert (status == 0).all()
            for place, x in zip(places, answers, strict=True):
                np.testing.assert_allclose(x, made.solve(qps[place]).x, atol=1e-10)
                seen += 1
        assert seen == len(qps)


def test_no_c_is_claimed_for_others() -> None:
    assert c_replay(get_solver("piqp")) is None


def test_a_cell_keeps_its_three_clocks_apart() -> None:
    recorded = problems("tiny")
    for solver, own, c in (("active-set", False, True), ("clarabel", True, False), ("thesis-active-set", False, False)):
        cell = TimedCell(Cell(HERE + "tiny", "joint-space-robust", solver), recorded, CONFIG)
        for repeat in range(3):
            cell.visit(repeat)
        frame, part = cell.result()
        assert (part.ticks, part.repeats, part.deterministic) == (12, 3, True)
        assert len(frame) == 3 * (12 + len(recorded.windows))
        assert frame["wall_setup"].is_not_null().sum() == 3 * len(recorded.windows)
        assert (frame["wall_setup"].is_null() == frame["wall_update"].is_not_null()).all()
        for name, has in (("own", own), ("c", c)):
            assert frame[name].null_count() == (0 if has else len(frame)), (solver, name)
            assert any(note.startswith(f"{name} is null") for note in part.notes) is not has
            if has:
                assert (frame[name] > 0.0).all()


def test_slow_solvers_get_fewer_of_the_same_problems() -> None:
    config = CONFIG.model_copy(update={"timing_budget": 0.3})
    cell = TimedCell(Cell(HERE + "tiny", "joint-space-robust", HERE + "Slow"), problems("tiny"), config)
    cell.visit(0)
    frame, part = cell.result()
    assert 1 <= part.ticks < 12
    assert set(frame["tick"]) <= set(ticks_of(problems("tiny").windows))


def test_visits_are_shuffled_anew_in_every_repeat_and_by_seed() -> None:
    recorded = problems("tiny")
    cells = [Cell(HERE + "tiny", "joint-space-robust", f"active-set(tolerance=1e-{k})") for k in range(5, 11)]

    def order(seed: int) -> list[list[Cell]]:
        seen: list[Cell] = []
        config = CONFIG.model_copy(update={"seed": seed, "timing_ticks": 2})
        done = time_block(recorded, cells, config, lambda cell, _: seen.append(cell), lambda *_: None)
        assert sorted(cell for cell, *_ in done) == sorted(cells)
        return [seen[i : i + 6] for i in range(0, 24, 6)]

    first, again, other = order(0), order(0), order(1)
    assert first == again
    assert first != other
    assert all(sorted(repeat) == sorted(cells) for repeat in first)
    assert len({tuple(repeat) for repeat in first}) > 1


def test_answers_that_change_between_repeats_are_noticed_and_mistakes_end_the_cell_alone() -> None:
    cells = [Cell(HERE + "tiny", "joint-space-robust", s) for s in (HERE + "Drifting", HERE + "Mistaken", "piqp")]
    failed: dict[Cell, str] = {}
    done = time_block(problems("tiny"), cells, CONFIG, lambda *_: None, failed.__setitem__)
    parts = {cell: part for cell, _, part in done}
    assert failed == {cells[1]: "KeyError: 'no such row'"}
    assert not parts[cells[0]].deterministic
    assert parts[cells[2]].deterministic


def test_a_continuation_does_the_visits_that_are_missing_in_the_order_of_the_whole() -> None:
    recorded = problems("tiny")
    cells = [Cell(HERE + "tiny", "joint-space-robust", name) for name in ("active-set", "clarabel", HERE + "Drifting")]
    whole: list[tuple[Cell, int]] = []
    kept: list[bytes] = []

    def until(stop: int) -> Callable[[Callable[[], dict[str, Progress]]], None]:
        def on_progress(progress: Callable[[], dict[str, Progress]]) -> None:
            kept.append(to_bytes(progress()))
            if len(kept) == stop:
                raise KeyboardInterrupt

        return on_progress

    note = lambda cell, repeat: whole.append((cell, repeat))  # noqa: E731  # two lines for it would say no more
    list(time_block(recorded, cells, CONFIG, note, lambda *_: None))
    seen: list[tuple[Cell, int]] = []
    with pytest.raises(KeyboardInterrupt):
        list(time_block(recorded, cells, CONFIG, lambda *visit: seen.append(visit), lambda *_: None,
                        on_progress=until(4)))  # fmt: skip
    assert seen == whole[:7]
    again: list[tuple[Cell, int]] = []
    begun = from_bytes(kept[-1])
    assert sorted(one.repeats for one in begun.values()) == [1, 1, 2]
    # In the reverse order of cells, as another process may have it.
    done = list(
        time_block(recorded, cells[::-1], CONFIG, lambda *visit: again.append(visit), lambda *_: None, begun=begun)
    )
    assert [visit for visit in again if visit[1] >= 0] == whole[7:]
    parts = {cell: (frame, part) for cell, frame, part in done}
    for cell in cells:
        frame, part = parts[cell]
        earlier = begun[cell.file_stem].frame
        assert frame.head(len(earlier)).equals(earlier)
        assert sorted(set(frame["repeat"])) == [0, 1, 2]
        assert part.repeats == 3
        assert len(frame) == 3 * len(frame.filter(frame["repeat"] == 0))
        assert set(frame.filter(frame["repeat"] == 2)["tick"]) == set(earlier["tick"])
    # What an earlier process was answered is compared with, too.
    assert [parts[cell][1].deterministic for cell in cells] == [True, True, False]


def test_a_baselines_visits_are_continued_too() -> None:
    from kinqp.benchmarks.baseline_block import BaselineBlock

    cell = Cell.of_baseline(HERE + "tiny", "task-priority")
    recorded = BaselineBlock(cell.block, CONFIG).problems
    kept: list[bytes] = []
    list(time_block(recorded, [cell], CONFIG, lambda *_: None, lambda *_: None,
                    on_progress=lambda progress: kept.append(to_bytes(progress()))))  # fmt: skip
    seen: list[int] = []
    ((_, frame, part),) = time_block(recorded, [cell], CONFIG, lambda _, repeat: seen.append(repeat), lambda *_: None,
                                     begun=from_bytes(kept[1]))  # fmt: skip
    assert seen == [-1, 2]
    assert (part.repeats, part.deterministic, sorted(set(frame["repeat"]))) == (3, True, [0, 1, 2])
