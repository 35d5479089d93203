"""Baselines in a sweep: the same loop, judged by what they promise, timed by what they resolve."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from kinqp.baselines import Baseline, Promise, Resolved, available_baselines, get_baseline
from kinqp.benchmarks import Block, Cell, SweepConfig, get_scenario, records, scorecard, sweep
from kinqp.benchmarks.baseline_block import BaselineBlock, TimedBaseline
from kinqp.benchmarks.problems import ticks_of
from kinqp.benchmarks.situations import Situations
from kinqp.control import make_step

if TYPE_CHECKING:
    from pathlib import Path

    import casadi as ca

    from kinqp.baselines import Situation
    from kinqp.formulations import Tick

HERE = "tests.benchmarks.tiny:"
OWN = f"{__name__}:"
CONFIG = SweepConfig(repeats=3, timing_ticks=12, timing_window=4)


@dataclass(frozen=True)
class Liar(Baseline):
    """Promises the bounds, and exceeds them at every other call of a run from the tenth on."""

    name: ClassVar[str] = "liar"
    promises: ClassVar[frozenset[Promise]] = frozenset({"joint bounds"})

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:
        """Nothing beyond rows and bounds."""
        del tick
        return {}

    def resolve(self, at: Situation) -> Resolved:
        """Give the command."""
        beyond = at.q[0] > get_scenario("semicircle").q0[0] + 1e-7
        return Resolved(at.qd_hi + 0.1 if beyond else np.full(at.nv, 1e-4))


class Unable(Liar):
    """Has a mistake in its code."""

    def resolve(self, at: Situation) -> Resolved:
        """Raise."""
        raise KeyError(f"no such row in {at.nv}")


def block(scenario: str, baseline: str = "task-priority") -> BaselineBlock:
    return BaselineBlock(Block(HERE + scenario, baseline, baseline=True), CONFIG)


def cell(scenario: str, baseline: str = "task-priority") -> Cell:
    return Cell.of_baseline(HERE + scenario, baseline)


def test_its_loop_is_that_of_the_step_itself() -> None:
    scenario = replace(
        get_scenario("semicircle"), phases=(replace(get_scenario("semicircle").only_phase, duration=0.02),)
    )
    step = make_step(scenario.robot, "weighted-least-norm", scenario.mode)
    frame, part = block("tiny", "weighted-least-norm").run(cell("tiny", "weighted-least-norm"))
    q, qd = np.array(scenario.q0), np.zeros(7)
    for tick, row in enumerate(frame.iter_rows(named=True)):
        v = scenario.guide.twist(tick * scenario.dt, scenario.robot.pose(q))[:3]
        given = {"qd_prev": qd} if "qd_prev" in step.inputs else {}
        result = step(q, v, dt=scenario.dt, **given)
        np.testing.assert_array_equal(row["q"], q)
        np.testing.assert_allclose(row["qd"], result.qd, atol=1e-14)
        np.testing.assert_allclose(row["eps"], result.eps, atol=1e-14)
        assert row["status"] == result.status.value
        q, qd = q + scenario.dt * result.qd, result.qd
    assert len(frame) == part.ticks == 20
    assert part.loop == "closed"
    assert frame["reference_error"].is_nan().all()
    assert set(frame["claimed"]) == {"solved"}


@pytest.mark.parametrize("scenario", ["tiny", "two_phases", "three_states"])
def test_situations_survive_being_written(scenario: str) -> None:
    recorded = block(scenario).problems
    read = Situations.from_bytes(recorded.to_bytes(), get_scenario(HERE + scenario))
    assert read.windows == recorded.windows
    assert list(read.states) == list(recorded.states) == sorted(ticks_of(recorded.windows))
    for tick, state in recorded.states.items():
        other = read.states[tick]
        assert (other.tick, other.phase, other.mode) == (state.tick, state.phase, state.mode)
        for name in ("q", "qd_prev", "v"):
            np.testing.assert_array_equal(getattr(other, name), getattr(state, name))


@pytest.mark.parametrize("scenario", ["tiny", "two_phases", "three_states"])
def test_what_is_timed_is_what_was_resolved(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made = block(scenario)
    frame, _ = made.run(cell(scenario))
    timed = TimedBaseline(cell(scenario), made.problems, CONFIG)
    seen: list[np.ndarray] = []
    kind = type(get_baseline("task-priority"))
    resolve = kind.resolve

    def noted(self: Baseline, at: Situation) -> Resolved:
        found = resolve(self, at)
        seen.append(found.qd)
        return found

    monkeypatch.setattr(kind, "resolve", noted)
    for repeat in range(3):
        timed.visit(repeat)
    order = [tick for window in made.problems.windows for tick in (window.lead, *window.ticks)]
    assert len(seen) == 3 * len(order)
    for tick, qd in zip(order, seen, strict=False):
        # The safe stop is sent where a promise is broken; here none is.
        np.testing.assert_allclose(qd, frame["qd"][tick], atol=1e-14)
    times, part = timed.result()
    assert (part.repeats, part.deterministic, part.loop) == (3, True, "replay")
    assert len(times) == 3 * part.ticks
    assert (times["wall_solve"] > 0.0).all()
    assert set(times["wall_update"]) == {0.0}
    assert all(times[name].null_count() == len(times) for name in ("wall_setup", "own", "c"))


def test_every_baseline_is_swept_and_scored_beside_a_formulation(tmp_path: Path) -> None:
    config = {
        "scenarios": [HERE + "tiny", HERE + "two_phases", HERE + "three_states"], "formulations": ["joint-space"],
        "solvers": ["active-set"], "baselines": ["all", OWN + "Liar", OWN + "Unable"], "repeats": 2,
        "timing_ticks": 4, "timing_window": 2,
    }  # fmt: skip
    store = sweep(config, tmp_path, workers=1)
    assert {(one.formulation, why) for one, why in store.failed().items()} == {
        (OWN + "Unable", "KeyError: 'no such row in 7'")
    }
    assert len(store.cells()) == 3 * (2 + len(available_baselines()))
    assert all(store.times(one) is not None for one in store.cells())
    table = records(store)
    for row in table.iter_rows(named=True):
        # Null where there is nothing to say; never NaN.
        assert not [name for name, value in row.items() if isinstance(value, float) and not np.isfinite(value)]
        if row["solver"] == "-":
            assert row["start"] == "-"
            assert (row["agreement"], row["compared"], row["setup_samples"]) == (None, 0.0, 0)
            assert row["wall_p50"] > 0.0
    honest = table.filter((table["solver"] == "-") & (table["formulation"] != OWN + "Liar"))
    assert set(honest["false_solved"]) == {0.0}
    # From rest and one small step on it is beyond where it lies.
    liar = table.filter((table["formulation"] == OWN + "Liar") & (table["scenario"] == HERE + "tiny"))
    assert liar["false_solved"][0] == pytest.approx(17 / 20, abs=0.06)
    names = scorecard(store).select("formulation", "solver").rows()
    assert names == [("joint-space", "active-set"), *((name, "-") for name in (*available_baselines(), OWN + "Liar"))]
