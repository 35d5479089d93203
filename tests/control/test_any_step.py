"""`simulate` with every kind of step, and what it hands on after a safe stop."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from kinqp.codegen import compile_step
from kinqp.control import make_step, simulate
from kinqp.solvers import QP, Solver, Status, get_solver
from kinqp.solvers.solution import RawSolution
from tests.control.test_loop import Recalling, Still
from tests.robots.chains import chain

if TYPE_CHECKING:
    from collections.abc import Callable

    from kinqp.control import AnyStep

ARM = chain(3)
Q = np.array([0.3, 0.1, 0.2])
MAKE: dict[str, Callable[[str], AnyStep]] = {
    "interpreted": lambda name: make_step(ARM, name, "position"),
    "compiled": lambda name: compile_step(ARM, name, "position"),
}
UNTOLD = ("fixed_error", "bound_violation", "sigma_min", "setup_time", "solve_time")


class LetGo:
    """A hand that pulls for 0.1 s, then beyond all that numbers can hold for some ticks, then not at all."""

    def __init__(self, lost: int) -> None:
        self.lost = range(100, 100 + lost)

    def twist(self, t: float, pose: np.ndarray) -> np.ndarray:  # noqa: ARG002  # the interface's arguments
        tick = round(t / 1e-3)
        if tick < self.lost.start:
            return np.array([0.1, 0.05, 0.0, 0.0, 0.0, 0.0])
        return np.full(6, 1e300) if tick in self.lost else np.zeros(6)


def test_a_compiled_step_runs_as_the_interpreted_one_does() -> None:
    ours, compiled = (simulate(make("joint-space"), LetGo(0), Q, 0.15) for make in MAKE.values())
    for name in ("t", "q", "v", "qd", "position", "eps", "q_end"):
        np.testing.assert_allclose(getattr(compiled, name), getattr(ours, name), atol=1e-9)
    assert compiled.status == ours.status
    assert compiled.active == ours.active
    assert compiled.iterations.tolist() == ours.iterations.tolist()
    assert set(compiled.message) == {""}
    for name in UNTOLD:
        assert getattr(compiled, name).shape == (150,)
        assert np.isnan(getattr(compiled, name)).all()
        assert np.isfinite(getattr(ours, name)).all()


def test_a_baseline_runs_too() -> None:
    run = simulate(make_step(chain(7), "weighted-least-norm", "position"), LetGo(0), np.full(7, 0.2), 0.15)
    assert set(run.status) == {Status.SOLVED}
    assert np.isfinite(run.sigma_min).all()


@pytest.mark.parametrize("kind", MAKE)
def test_an_arm_that_was_stopped_stays_where_it_has_come_to_rest(kind: str) -> None:
    step = MAKE[kind]("joint-space-robust")
    stopping = simulate(step, LetGo(40), Q, 0.14).qd
    rest = int(np.argmin(np.any(stopping[100:] != 0.0, axis=1)))
    assert 5 < rest < 39
    # The hand is gone at the very tick in which the arm has come to rest, by an acceleration of several rad/s^2.
    run = simulate(step, LetGo(rest + 1), Q, 0.2)
    assert Status.SOLVED not in run.status[100 : 101 + rest]
    assert set(run.status[101 + rest :]) == {Status.SOLVED}
    assert np.abs(run.qd[99 + rest]).max() > 1e-3
    assert np.abs(run.qd[100 + rest :]).max() < 1e-12


class FailingOnce(Solver):
    """The default solver, which gives up at its second problem."""

    name: ClassVar[str] = "failing-once"

    def __init__(self) -> None:
        super().__init__(tolerance=1e-9)
        self._solver = get_solver("active-set")
        self._calls = 0

    def _setup(self, qp: QP) -> None:
        pass

    def _update(self, qp: QP) -> None:
        pass

    def _solve(self, qp: QP) -> RawSolution:
        self._calls += 1
        s = self._solver.solve(qp)
        status = Status.FAILED if self._calls == 2 else s.status
        return RawSolution(claimed=status, x=s.x, y=s.y, z=s.z, z_box=s.z_box, iterations=1)


def test_after_a_safe_stop_the_last_acceleration_is_none() -> None:
    """1 mm/s, the stop, and then as from the start: 1, 1 + 1."""
    run = simulate(make_step(ARM, Recalling(), "position", FailingOnce()), Still(), np.zeros(3), 0.004)
    assert [status is Status.SOLVED for status in run.status] == [True, False, True, True]
    np.testing.assert_allclose(run.qd, np.outer(1e-3 * np.array([1, 0, 1, 2]), np.ones(3)), atol=1e-15)


def test_what_a_capped_tick_has_come_to_is_no_stop() -> None:
    """A step that keeps to admissible points: its acceleration is one to go on with."""
    step = compile_step(ARM, "joint-space-robust", "position", feasible=True, max_iterations=2)
    run = simulate(step, LetGo(0), Q, 0.1)
    capped = [status is Status.MAX_ITERATIONS for status in run.status]
    assert np.abs(run.qd[capped]).max() > 0.01
    again = compile_step(ARM, "joint-space-robust", "position", feasible=True, max_iterations=2)
    qd, qdd, q = np.zeros(3), np.zeros(3), Q
    for tick in range(100):
        sent = again(q, run.v[tick], qd_prev=qd, qdd_prev=qdd).qd
        np.testing.assert_array_equal(sent, run.qd[tick])
        qdd, qd, q = (sent - qd) / 1e-3, sent, q + 1e-3 * sent


@pytest.mark.parametrize("dt", [1e-320, 9e-6, 1.1, 1e308, np.inf])
def test_periods_out_of_range_are_refused(dt: float) -> None:
    with pytest.raises(ValueError, match=r"^dt: expected 1e-05 to 1 s"):
        simulate(MAKE["interpreted"]("joint-space"), Still(), Q, 1.0, dt=dt)
