"""Acceleration-level formulations in generated C: the same commands, the same safe stop, batches, export."""

from __future__ import annotations

import shutil
import subprocess
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinqp.codegen import export_c
from kinqp.formulations import InputError, Mode
from kinqp.solvers import Status
from tests.codegen.compiled import compiled, interpreted, near
from tests.codegen.test_parity import weakest_locked, with_limits
from tests.control.states import states
from tests.formulations.acceleration_level import MODES, NAMES
from tests.formulations.reference import bounds_at, rows_at
from tests.robots.arms import arm

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from kinqp.robots import Robot

    Array = NDArray[np.float64]

NARROW = 2.0
# Compiled and interpreted are to agree to 1e-9; a last command that contradicts the locked rows by 1 rad/s, as in these
# tests, makes multipliers of 1e4 and more beside a joint weight of 1e-4. The compiled step, which doesn't refine, is
# off by up to 2.5e-9 then (panda at q = 0), measured against the same active set solved in exact fractions.
PARITY = 5e-9


def ticks(robot: str, mode: str, count: int, seed: int = 0) -> list[tuple[str, Array, Array, Array]]:
    """Draw (kind, q, v, qd_prev): half of the states near `NARROW`; any last command, against locked rows as well."""
    made, rng, m = arm(robot), np.random.default_rng(seed), Mode.parse(mode).m_free
    low, high = np.maximum(made.q_min, -NARROW), np.minimum(made.q_max, NARROW)
    kinds = [*states(made, count // 2, seed), *(("near limits", near(low, high, rng)) for _ in range(count // 2))]
    drawn = []
    for kind, q in kinds:
        v = rng.normal(size=m) * rng.choice([0.0, 0.01, 0.2, 2.0])
        drawn.append((kind, q, v, rng.uniform(-1.0, 1.0, made.nv) * made.qd_max * rng.choice([0.0, 1e-3, 0.1, 1.0])))
    return drawn


def narrowed(robot: Robot) -> dict[str, Array]:
    """Position limits away from full turns, where some wrists are singular."""
    return {"q_min": np.maximum(robot.q_min, -NARROW), "q_max": np.minimum(robot.q_max, NARROW)}


def check_parity(robot: str, name: str, mode: str, count: int) -> None:
    step, reference = compiled(robot, name, mode, quick=True), interpreted(robot, name, mode)
    compared = held = unanswered = 0
    for kind, q, v, qd in ticks(robot, mode, count):
        case = f"{robot}, {name}, {mode}, {kind}, q={q!r}, v={v!r}, qd_prev={qd!r}"
        limits = narrowed(step.robot) if kind == "near limits" else {}
        result, wanted = step(q, v, qd_prev=qd, **limits), reference(q, v, qd_prev=qd, **limits)
        low, high = bounds_at(with_limits(step.robot, **limits), q)
        assert (result.qd >= low - 2e-9).all(), case
        assert (result.qd <= high + 2e-9).all(), case
        free, locked = rows_at(step.robot, step.mode, q)
        np.testing.assert_allclose(free @ result.qd - v, result.eps, rtol=0, atol=1e-9)
        if Status.SOLVED not in (result.status, wanted.status) or result.status is not wanted.status:
            unanswered += 1
            continue
        share = np.maximum(np.abs(locked) @ np.abs(result.qd), 1.0)
        assert (np.abs(locked @ result.qd) <= 1e-9 * share).all(), case
        held += bool(result.active)
        # On a limit and singular at once the optimum is ill-posed; safety, above, isn't.
        if min(wanted.sigma_min, weakest_locked(step, q)) > 1e-3:
            compared += 1
            scale = max(1.0, float(np.abs(wanted.qd).max()))
            assert np.abs(result.qd - wanted.qd).max() <= PARITY * scale, case
    assert compared > count // 4
    assert held > count // 2
    assert unanswered <= count // 20


QUICK = (
    ("ur5e", "cartesian-error-acceleration", "fix-position"),
    ("lbr_med14", "joint-space-acceleration", "fix-orientation"),
    ("panda", "minimum-acceleration-norm", "rcm:0.1"),
    ("lbr_med14", "minimum-torque-norm", "line:z"),
)


@pytest.mark.parametrize(("robot", "name", "mode"), QUICK)
def test_compiled_and_interpreted_steps_agree(robot: str, name: str, mode: str) -> None:
    check_parity(robot, name, mode, 48)


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e", "panda"])
@pytest.mark.parametrize("name", [*NAMES, "joint-space-acceleration(torque_limits=true)"])
def test_they_agree_on_many_states(name: str, robot: str, mode: str) -> None:
    check_parity(robot, name, mode, 1200)


def test_both_brake_alike_where_a_tick_is_not_solved() -> None:
    """Capped at no iterations at all: the safe stop, and its error, are those of the interpreted step."""
    for robot, name, mode in QUICK[:2]:
        step = compiled(robot, name, mode, quick=True, max_iterations=0)
        reference, stopped = interpreted(robot, name, mode), 0
        for kind, q, v, qd in ticks(robot, mode, 24, seed=1):
            result, instance = step(q, v, qd_prev=qd), reference.evaluate(q, v, qd_prev=qd)
            if result.status is Status.SOLVED:
                continue
            assert result.status is Status.MAX_ITERATIONS, kind
            np.testing.assert_allclose(result.qd, instance.stop, rtol=1e-14, atol=1e-15)
            np.testing.assert_allclose(result.eps, instance.J_free @ instance.stop - v, rtol=0, atol=1e-12)
            last = np.clip(qd, -step.robot.qd_max, step.robot.qd_max)
            assert (np.abs(result.qd - last) <= step.robot.qdd_max * 1e-3 * (1.0 + 1e-9)).all()
            stopped += bool(result.qd.any())
        assert stopped > 5


def test_a_capped_tick_of_a_feasible_step_is_safe() -> None:
    """And is not refused, however large its stretch; where nothing is left of the numbers, it brakes."""
    step = compiled(
        "lbr_med14", "joint-space-acceleration", "fix-orientation", quick=True, feasible=True, max_iterations=1
    )
    reference, seen = interpreted("lbr_med14", "joint-space-acceleration", "fix-orientation"), Counter[Status]()
    for kind, q, v, qd in ticks("lbr_med14", "fix-orientation", 60, seed=2):
        for speed in (1.0, 1e12):
            result = step(q, speed * v, qd_prev=qd)
            seen[result.status] += speed == 1.0
            low, high = bounds_at(step.robot, q)
            assert (result.qd >= low - 2e-9).all(), kind
            assert (result.qd <= high + 2e-9).all(), kind
            if result.status in (Status.SOLVED, Status.MAX_ITERATIONS):
                _, locked = rows_at(step.robot, step.mode, q)
                assert (np.abs(locked @ result.qd) <= 1e-9 * np.maximum(np.abs(locked) @ np.abs(result.qd), 1.0)).all()
            else:
                stop = reference.evaluate(q, speed * v, qd_prev=qd).stop
                np.testing.assert_allclose(result.qd, stop, rtol=1e-14, atol=1e-15)
    assert seen[Status.MAX_ITERATIONS] > 30
    assert set(seen) == {Status.SOLVED, Status.MAX_ITERATIONS}


def test_batches_take_the_last_commands() -> None:
    step = compiled("lbr_med14", "joint-space-acceleration", "fix-orientation", quick=True)
    drawn = ticks("lbr_med14", "fix-orientation", 24, seed=3)
    Q, V, P = (np.array([tick[i] for tick in drawn]) for i in (1, 2, 3))
    drift = np.full((len(Q), 3), 1e-3)
    drift[:, 1] = 0.0
    many = step.batch(Q, V, qd_prev=P, v_fixed=drift, time_constant=0.02)
    for i, (q, v, qd) in enumerate(zip(Q, V, P, strict=True)):
        one = step(q, v, qd_prev=qd, v_fixed=drift[i], time_constant=0.02)
        assert one.qd.tobytes() == many.qd[i].tobytes()
        assert one.status is many.status[i]
    with pytest.raises(InputError, match=r"qd_prev: expected shape \(24, 7\), got nothing"):
        step.batch(Q, V)
    with pytest.raises(InputError, match=r"qd_prev: expected shape \(24, 7\), one row for each tick, got \(7,\)"):
        step.batch(Q, V, qd_prev=np.zeros(7))


def test_what_is_not_finite_stops_its_own_tick_only() -> None:
    step = compiled("lbr_med14", "joint-space-acceleration", "fix-orientation", quick=True)
    Q, V = np.tile([0.1, 0.5, 0.1, -1.0, 0.0, 1.0, 0.0], (4, 1)), np.full((4, 3), 0.01)
    P = np.full((4, 7), 0.2)
    Q[1, 2], P[2, 3], V[3, 0] = np.nan, np.inf, np.nan
    result = step.batch(Q, V, qd_prev=P)
    assert [status is Status.FAILED for status in result.status] == [False, True, True, True]
    assert not result.qd[2].any()  # how fast it goes isn't known
    np.testing.assert_allclose(result.qd[[1, 3]], 0.19, atol=1e-15)  # where it is, and the hand, isn't needed to brake


@pytest.mark.parametrize(
    "modes", [["fix-orientation"], pytest.param(["fix-orientation", "line:z", "free"], marks=pytest.mark.long)]
)
def test_exported_code_gives_the_recorded_answers(modes: list[str], tmp_path: Path) -> None:
    """With the last command as an input of every recorded tick; one mode, and several, which bring other code."""
    export_c(arm("lbr_med14"), "cartesian-error-acceleration", modes, tmp_path, name="lbr")
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler is not None
    flags = ["-std=c99", "-O0", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-ffp-contract=off"]
    built = subprocess.run(
        [compiler, *flags, "main.c", "lbr.c", "-lm", "-o", "check"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    done = subprocess.run([str(tmp_path / "check")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert f"{200 * len(modes)} ticks" in done.stdout
    readme = (tmp_path / "README.md").read_text()
    assert "input.qd_prev[i] = sent[i];" in readme
    assert "output.qd is the fastest admissible braking: the safe stop" in readme
    header = (tmp_path / "lbr.h").read_text()
    assert "braking unless solved" in header
    assert "double qd_prev[7]; /* joint velocities of the tick before [rad/s or m/s] */" in header
