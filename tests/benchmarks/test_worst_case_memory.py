"""The search for the worst tick over what came before: last accelerations, drawn, moved, stored, replayed and timed."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from typer.testing import CliRunner

from kinqp.benchmarks.worst_case import Batch, CaseError, Found, WorstCase, read_case, replay, search, write_case
from kinqp.benchmarks.worst_case.states import Draws
from kinqp.benchmarks.worst_case.timing import Stopwatch
from kinqp.cli.app import app
from kinqp.codegen import CompiledStep, compile_step
from kinqp.robots import load_robot

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

MODE = "fix-orientation"
TIGHT = {"qdd_max": np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])}


@pytest.fixture(scope="module")
def robust() -> CompiledStep:
    return compile_step(load_robot("lbr_med14"), "joint-space-robust", MODE)


@pytest.fixture(scope="module")
def plain() -> CompiledStep:
    return compile_step(load_robot("lbr_med14"), "joint-space", MODE)


def alike(_: Stopwatch, states: Sequence[Batch]) -> list[float]:
    """Ticks of these tests are counted; timing them takes longer than the search."""
    return [1e-6] * len(states)


@pytest.fixture
def untimed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Stopwatch, "seconds", alike)


@pytest.fixture(scope="module")
def found(robust: CompiledStep) -> WorstCase:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stopwatch, "seconds", alike)
        return search(robust, ticks=40_000, seed=1)


def draws(step: CompiledStep, seed: int = 5) -> Draws:
    return Draws(step, np.random.default_rng(seed))


def locked_speeds(step: CompiledStep, q: NDArray[Any], qd: NDArray[Any]) -> NDArray[Any]:
    """Largest speed along the locked rows, which are the rotations."""
    return np.array([np.abs(step.robot.jacobian(each)[3:] @ x).max() for each, x in zip(q, qd, strict=True)])


def test_last_accelerations_are_unknown_on_bounds_within_and_beyond(robust: CompiledStep) -> None:
    for limits, most in (({}, robust.robot.qdd_max), (TIGHT, TIGHT["qdd_max"])):
        share = np.abs(draws(robust).anywhere(4_000, limits).qdd_prev / most)
        unknown, finite = np.isinf(share), np.where(np.isinf(share), 0.0, share)
        assert 0.15 < unknown.all(axis=1).mean() < 0.25
        assert 0.03 < (unknown.any(axis=1) & ~unknown.all(axis=1)).mean() < 0.07
        assert (finite == 1.0).any(axis=1).mean() > 0.1
        assert 0.02 < (finite > 1.0 + 1e-12).any(axis=1).mean() < 0.15
        assert finite.max() <= 3.0 + 1e-12
        assert (share < 1.0).all(axis=1).mean() > 0.3
        assert (share == 0.0).all(axis=1).mean() > 0.05
    both = np.unique(np.sign(draws(robust).anywhere(4_000, {}).qdd_prev))
    np.testing.assert_array_equal(both, [-1.0, 0.0, 1.0])


def test_half_of_the_last_ticks_keep_the_locked_rows(robust: CompiledStep) -> None:
    drawn = draws(robust)
    for batch in (drawn.anywhere(600, {}), drawn.near(drawn.anywhere(1, {}), 600)):
        known = np.isfinite(batch.qdd_prev).all(axis=1)
        keeps = locked_speeds(robust, batch.q, batch.qd_prev) < 1e-12
        assert 0.4 < keeps.mean() < 0.6
        both = keeps & known
        assert (locked_speeds(robust, batch.q[both], batch.qdd_prev[both]) < 1e-10).all()
        assert (np.abs(batch.qd_prev) <= robust.robot.qd_max).all()
        assert (np.abs(batch.qd_prev[keeps]) / robust.robot.qd_max).max() > 0.9


def test_only_last_ticks_that_keep_the_locked_rows_feel_the_jerk_limit(robust: CompiledStep) -> None:
    batch = draws(robust).anywhere(2_000, {})
    keeps = locked_speeds(robust, batch.q, batch.qd_prev) < 1e-12
    told = robust.batch(batch.q, batch.v, **batch.inputs(robust)).qd
    deaf = robust.batch(batch.q, batch.v, qd_prev=batch.qd_prev).qd
    differ = (told != deaf).any(axis=1)
    assert differ[keeps].mean() > 0.4
    assert differ[~keeps].mean() < 0.1


def test_last_accelerations_are_moved(robust: CompiledStep) -> None:
    drawn, most = draws(robust), robust.robot.qdd_max
    q, v = np.array([[0.1, 0.7, 0.2, -1.6, 0.3, 0.4, 0.5]]), np.array([[0.1, 0.2, 0.3]])
    start = np.array([[1.0, -2.0, 3.0, -4.0, np.inf, -np.inf, 7.0]])
    moved = drawn.near(Batch(q, v, np.zeros((1, 7)), start, TIGHT), 4_000).qdd_prev
    assert (moved != start).any(axis=1).mean() > 0.95
    distance = np.abs(np.where(np.isinf(moved), 0.0, moved) - np.where(np.isinf(start), 0.0, start)).max(axis=1)
    assert (distance < 1e-2).mean() > 0.05
    assert (distance > 0.5).mean() > 0.2
    assert 0.7 < (moved[:, 4] == np.inf).mean() < 0.95
    assert 0.7 < (moved[:, 5] == -np.inf).mean() < 0.95
    assert np.isinf(moved[:, 0]).mean() < 0.1
    share = np.abs(moved / TIGHT["qdd_max"])
    assert share[np.isfinite(share)].max() <= 3.0 + 1e-12 < most[0]
    assert (share == 1.0).any(axis=1).mean() > 0.1


def test_all_else_is_drawn_as_without_them(plain: CompiledStep, robust: CompiledStep) -> None:
    pairs = []
    for step in (plain, robust):
        drawn = draws(step)
        start = drawn.anywhere(3, {})
        pairs.append([start, drawn.near(start.pick(1), 3), drawn.anywhere(3, {})])
    for without, with_them in zip(*pairs, strict=True):
        assert np.isinf(without.qdd_prev).all()
        np.testing.assert_array_equal(without.v, with_them.v)
        np.testing.assert_array_equal(without.q, with_them.q)
    # As before last accelerations were searched.
    figures = [[x.q[2, 0], x.v[2, 0], x.qd_prev[2, 6]] for x in pairs[0]]
    before = [
        [2.359866431802958, 0.0271464631676932, 0.2680586426971274],
        [-2.7338718676861857, -0.10185325457814363, -0.028130365364942806],
        [-2.9670597283179494, 0.004735968160081036, -0.6618624732616019],
    ]
    np.testing.assert_allclose(figures, before, rtol=1e-12)


@pytest.mark.usefixtures("untimed")
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_search_with_them_finds_as_many_iterations_as_one_without(
    robust: CompiledStep, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    most = search(robust, ticks=40_000, seed=seed).most
    inputs = {name: np.array(x) for name, x in most.limits.items()}
    told = robust(most.q, most.v, **inputs, qd_prev=most.qd_prev, qdd_prev=most.qdd_prev)
    assert (told.iterations, told.status.value, list(told.active)) == (most.iterations, most.status, most.active)
    memory = Batch.memory

    def without(self: Batch, step: CompiledStep) -> dict[str, NDArray[Any]]:
        return {name: rows for name, rows in memory(self, step).items() if name != "qdd_prev"}

    monkeypatch.setattr(Batch, "memory", without)
    assert most.iterations >= search(robust, ticks=40_000, seed=seed).most.iterations


def strict(text: str) -> Any:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.usefixtures("untimed")
def test_a_case_is_stored_and_replayed_bit_for_bit(found: WorstCase, tmp_path: Path) -> None:
    assert np.isfinite(found.most.qdd_prev).any()
    path = tmp_path / "case.json"
    write_case(found, path)
    case = read_case(path)
    assert case == found
    again = replay(case)
    for then, now in ((found.most, again.most), (found.slowest, again.slowest)):
        assert now == replace(then, seconds=1e-6)


def test_infinities_are_words_in_the_file(found: WorstCase, tmp_path: Path) -> None:
    odd = [np.inf, -np.inf, -0.0, 5e-324, 0.1, 1.7976931348623157e308, -1e-17]
    state = replace(found.most, qdd_prev=odd, limits={"q_min": [-np.inf] * 7, "q_max": [np.inf] * 6 + [1.0]})
    path = tmp_path / "case.json"
    write_case(replace(found, most=state), path)
    assert strict(path.read_text())["most"]["qdd_prev"][:2] == ["inf", "-inf"]
    read = read_case(path).most
    assert np.array(read.qdd_prev).tobytes() == np.array(odd).tobytes()
    assert read.limits == state.limits
    assert read.state().qdd_prev.tobytes() == np.array(odd).tobytes()
    given = json.loads(path.read_text())
    given["most"]["qdd_prev"][0] = "endless"
    path.write_text(json.dumps(given))
    with pytest.raises(CaseError, match=r"case\.json: expected a file that kinqp worst-case has written: .*endless"):
        read_case(path)


@pytest.mark.usefixtures("untimed")
def test_a_file_of_an_earlier_version_replays_with_last_accelerations_unknown(
    robust: CompiledStep, found: WorstCase, tmp_path: Path
) -> None:
    """What such a file says of the tick is what the step does without being told."""
    given = found.most
    inputs = {name: np.array(x) for name, x in given.limits.items()}
    result = robust(given.q, given.v, **inputs, qd_prev=given.qd_prev)
    assert result.iterations != given.iterations  # told, the tick is another one
    path = tmp_path / "old.json"
    write_case(found, path)
    old = json.loads(path.read_text())
    for name in ("most", "slowest"):
        del old[name]["qdd_prev"]
        old[name] |= {"q": given.q, "v": given.v, "qd_prev": given.qd_prev, "limits": given.limits}
        old[name] |= {"iterations": result.iterations, "status": result.status.value}
    path.write_text(json.dumps(old))
    case = read_case(path)
    assert case.most.qdd_prev == [np.inf] * 7
    again = replay(case)
    assert (again.most.iterations, again.most.active) == (result.iterations, list(result.active))
    done = CliRunner().invoke(app, ["worst-case", "--replay", str(path)])
    assert done.exit_code == 0, done.output
    assert "last acc. known" not in done.output


@pytest.mark.usefixtures("untimed")
def test_the_command_line_says_what_is_known(found: WorstCase, tmp_path: Path) -> None:
    path = tmp_path / "case.json"
    known = replace(found.most, qdd_prev=[*found.most.qdd_prev[:6], np.inf])
    write_case(replace(found, slowest=known), path)
    done = CliRunner().invoke(app, ["worst-case", "--replay", str(path)])
    assert "last acc. known" in done.output
    assert "6 of 7" in done.output


class _Listening:
    """Takes what the stopwatch passes on."""

    def __init__(self, inputs: tuple[str, ...]) -> None:
        self.inputs = inputs
        self.given: list[Mapping[str, Any]] = []

    def batch(self, q: NDArray[Any], v: NDArray[Any], **inputs: Any) -> None:
        self.given.append({"q": q, "v": v, **inputs})


def test_ticks_are_timed_with_them(robust: CompiledStep, plain: CompiledStep) -> None:
    batch = draws(robust).anywhere(1, TIGHT)
    for step in (robust, plain):
        listening: Any = _Listening(step.inputs)
        Stopwatch(listening, 0).seconds([batch])
        for given in listening.given:
            assert ("qdd_prev" in given) == (step is robust)
            for name in {"q", "v", "qd_prev", "qdd_prev"} & set(given):
                assert len(given[name]) > 1
                assert (given[name] == getattr(batch, name)).all()


def test_what_is_found_is_described_with_what_it_was_told(robust: CompiledStep) -> None:
    batch = draws(robust).anywhere(200, {})
    many = robust.batch(batch.q, batch.v, **batch.inputs(robust))
    for index in range(len(batch)):
        one = Found.of(robust, batch.pick(index), None)
        assert one.iterations == many.iterations[index]
        assert one.qdd_prev == batch.qdd_prev[index].tolist()
