"""The timing part: which problems, in which order, and that C solves the same ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinqp.benchmarks import Block, Cell, SweepConfig
from kinqp.benchmarks.accuracy import PreparedBlock
from kinqp.benchmarks.problems import Problems, choose_windows, ticks_of
from kinqp.benchmarks.replay import TimedCell, time_block
from kinqp.benchmarks.timing_c import c_replay
from kinqp.solvers import get_solver

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
