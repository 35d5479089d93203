"""Hierarchies as C: the interpreted cascade's answers, strict in order, safe where a tick is not solved."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from kinqp.codegen import compile_step
from kinqp.codegen import step as step_module
from kinqp.control import make_step
from kinqp.formulations import DeclarationError, Formulation, Hierarchical, Hierarchy, command_above
from kinqp.solvers import Status
from tests.codegen.compiled import QUICK_FLAGS, compiled, interpreted
from tests.formulations.reference import adversarial_state, bounds_at
from tests.robots.arms import arm

if TYPE_CHECKING:
    from kinqp.codegen import CompiledStep
    from kinqp.formulations import QuadraticProgram, Tick

# Closer to a singularity the task level's answer is off by its residual over the square of this.
REGULAR = 1e-3
CASES = [("lbr_med14", "fix-orientation"), ("ur5e", "free"), ("lbr_med7", "fix-position")]
MORE = [
    (robot, mode)
    for robot in ("lbr_med14", "ur5e", "lbr_med7")
    for mode in ("free", "line:z", "fix-position", "fix-orientation", "rcm:-0.1")
    if (robot, mode) not in CASES
]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile with less optimisation: the bits of the answer don't depend on it."""
    monkeypatch.setattr(step_module, "STEP_FLAGS", QUICK_FLAGS)


@pytest.mark.parametrize(("robot", "mode"), [*CASES, *(pytest.param(*case, marks=pytest.mark.long) for case in MORE)])
def test_parity_with_the_interpreted_cascade(robot: str, mode: str) -> None:
    """On random states, on limits and beyond them, with every kind of input."""
    step, other = compiled(robot, "hierarchical", mode, quick=True), interpreted(robot, "hierarchical", mode)
    rng = np.random.default_rng(7)
    assert set(step.inputs) == set(other.inputs)
    compared = held = same = 0
    for tick in range(120):
        q = adversarial_state(arm(robot), rng)
        v = rng.normal(size=other.mode.m_free) * rng.choice([0.0, 0.01, 0.2, 2.0])
        inputs = {}
        if tick % 3 == 0:
            inputs = {
                "v_fixed": 0.01 * rng.normal(size=other.mode.m_fixed),
                "posture": rng.normal(size=arm(robot).nv),
                "posture_gain": 2.0,
                "task_weight": rng.uniform(0.5, 2.0, other.mode.m_free),
                "joint_weight": rng.uniform(0.5, 2.0, arm(robot).nv),
                "qd_max": 0.5,
            }
        got, wanted = step(q, v, **inputs), other(q, v, **inputs)
        if wanted.sigma_min < REGULAR:
            if got.status is wanted.status is Status.SOLVED:
                np.testing.assert_allclose(got.eps, wanted.eps, atol=1e-5)
            continue
        assert got.status is wanted.status
        np.testing.assert_allclose(got.qd, wanted.qd, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(got.eps, wanted.eps, rtol=1e-9, atol=1e-9)
        compared += got.status is Status.SOLVED
        held += bool(got.active)
        same += got.active == wanted.active
        at = other.evaluate(q, v, **inputs)
        for name in {*got.active, *wanted.active}:
            # Where more rows meet than are needed either choice of them is right, but all of them are met.
            joint, side = re.fullmatch(r"joint limits\[(\d)\] (upper|lower)", name).groups()  # type: ignore[union-attr]  # fails if not
            assert got.qd[int(joint)] == pytest.approx(
                (at.qd_hi if side == "upper" else at.qd_lo)[int(joint)], abs=2e-6
            )
    assert compared > 20
    assert held > 10
    assert same >= 0.9 * compared


def test_a_batch_is_its_ticks() -> None:
    step, rng = compiled("lbr_med14", "hierarchical", "fix-orientation", quick=True), np.random.default_rng(1)
    Q = np.array([adversarial_state(arm("lbr_med14"), rng) for _ in range(40)])
    V, drift = 0.3 * rng.normal(size=(40, 3)), 0.01 * rng.normal(size=(40, 3))
    Q[3, 2] = np.nan
    batch = step.batch(Q, V, v_fixed=drift, posture_gain=1.0)
    assert batch.status[3] is Status.FAILED
    assert not batch.qd[3].any()
    for i in (*range(3), *range(4, 40)):
        one = step(Q[i], V[i], v_fixed=drift[i], posture_gain=1.0)
        np.testing.assert_array_equal(one.qd, batch.qd[i])
        np.testing.assert_array_equal(one.sides, batch.sides[i])
        assert one.status is batch.status[i]


def test_the_task_yields_to_nothing_and_the_posture_to_the_task() -> None:
    """SciPy's least Cartesian error within the bounds, whatever the posture asks for."""
    robot, rng = arm("ur5e"), np.random.default_rng(3)
    redundant = compiled("lbr_med14", "hierarchical", "fix-orientation", quick=True)
    step, moved, short = compiled("ur5e", "hierarchical", "free", quick=True), 0, 0
    for _ in range(40):
        q, v = robot.random_configuration(rng), rng.normal(size=6)
        low, high = bounds_at(robot, q)
        least = lsq_linear(robot.jacobian(q), v, (low, high), tol=1e-14)
        got = step(q, v)
        assert got.status is Status.SOLVED
        assert np.linalg.norm(got.eps) == pytest.approx(np.sqrt(2.0 * least.cost), abs=1e-7)
        short += least.cost > 1e-6
        state, hand = adversarial_state(arm("lbr_med14"), rng), 0.2 * rng.normal(size=3)
        rests, pulls = (redundant(state, hand, posture_gain=gain) for gain in (0.0, 5.0))
        if rests.status is pulls.status is Status.SOLVED:
            np.testing.assert_allclose(pulls.eps, rests.eps, atol=1e-9)
            moved += bool(np.abs(pulls.qd - rests.qd).max() > 1e-3)
    assert short > 10
    assert moved > 4


@pytest.mark.parametrize("cap", [0, 1, 2])
def test_a_capped_tick_stops_or_keeps_to_what_was_decided(cap: int) -> None:
    robot, rng = arm("lbr_med14"), np.random.default_rng(4)
    step = compiled("lbr_med14", "hierarchical", "fix-orientation", quick=True, max_iterations=cap)
    keeps = compiled("lbr_med14", "hierarchical", "fix-orientation", quick=True, max_iterations=cap, feasible=True)
    capped = 0
    for _ in range(60):
        q, v = adversarial_state(robot, rng), rng.normal(size=3)
        stopped, kept = step(q, v), keeps(q, v)
        assert stopped.iterations <= cap
        assert kept.status is stopped.status
        if stopped.status is Status.MAX_ITERATIONS:
            capped += 1
            low, high = bounds_at(robot, q)
            assert not stopped.qd.any()
            assert np.all((kept.qd >= low - 1e-8) & (kept.qd <= high + 1e-8))
            np.testing.assert_allclose(robot.jacobian(q)[3:] @ kept.qd, 0.0, atol=1e-9)
    assert capped > 5


@dataclass(frozen=True)
class StandStill(Formulation):
    """The least motion within acceleration limits."""

    name: ClassVar[str] = "stand-still"
    safe_stop: ClassVar[Literal["zero", "braking"]] = "braking"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        qd = qp.variable("qd", tick.nv)
        qp.minimize(qd, name="speed")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)


@dataclass(frozen=True)
class Below(StandStill):
    """A level below it that moves one joint, by a penalty, with an inequality that names its row."""

    name: ClassVar[str] = "below"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        z, above = qp.variable("z", tick.nv), command_above(tick)
        qp.minimize(z, name="motion")
        qp.minimize(above[0] + z[0] - 1.0, weight=10.0, name="turn")
        qp.between(-0.1, z[0] + z[1], 0.1, name="together")
        qp.command(above + z)


@dataclass(frozen=True)
class Braking(Hierarchy):
    """Two levels whose safe stop is braking."""

    name: ClassVar[str] = "braking-levels"

    @property
    def levels(self) -> tuple[Formulation, ...]:
        """Stand still, turn."""
        return StandStill(self.bounds), Below(self.bounds)


@dataclass(frozen=True)
class Three(Hierarchy):
    """The two of `hierarchical`, and one below."""

    name: ClassVar[str] = "three-levels"

    @property
    def levels(self) -> tuple[Formulation, ...]:
        """Task, posture, turn."""
        return *Hierarchical(self.bounds).levels, Below(self.bounds)


def test_levels_of_all_kinds_and_their_braking() -> None:
    """Rows that are not bounds, no equalities, no declared point; and a tick that is not solved brakes."""
    robot = arm("ur5e")
    step, other = compile_step(robot, Braking(), "position"), make_step(robot, Braking(), "position")
    stopped: CompiledStep = compile_step(robot, Braking(), "position", max_iterations=0)
    q, v, before = np.array([0.1, -1.0, 1.2, 0.3, 0.4, 0.5]), np.array([0.1, 0.0, 0.0]), 0.05 * np.ones(6)
    got, wanted = step(q, v, qd_prev=before), other(q, v, qd_prev=before)
    assert got.status is wanted.status is Status.SOLVED
    np.testing.assert_allclose(got.qd, wanted.qd, atol=1e-12)
    assert got.active == wanted.active
    assert "together[0] upper" in got.active or "together upper" in got.active
    capped = stopped(q, v, qd_prev=before)
    assert capped.status is Status.MAX_ITERATIONS
    np.testing.assert_allclose(capped.qd, other.evaluate(q, v, qd_prev=before).stop, atol=1e-15)
    np.testing.assert_allclose(capped.eps, robot.jacobian(q)[:3] @ capped.qd - v, atol=1e-12)


def test_levels_have_to_agree_on_the_safe_stop() -> None:
    with pytest.raises(DeclarationError, match=re.escape("one safe stop of all levels, got task: zero, posture: zero")):
        compile_step(arm("ur5e"), Three(), "position")


def test_the_generated_solver_of_casadi_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"solver: expected active-set for hierarchical, which is several QPs in order"
    ):
        compile_step(arm("ur5e"), "hierarchical", "position", "casadi-qrqp")
