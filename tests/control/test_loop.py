"""The closed loop and its paths."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from kinqp.control import PathFollower, SemicirclePath, make_step, simulate
from kinqp.formulations import Formulation, QuadraticProgram, Tick
from kinqp.robots import load_robot
from kinqp.solvers import Status
from tests.finite_differences import difference_jacobian

X, Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
PATH = SemicirclePath(np.array([0.1, -0.2, 0.3]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), 0.25)
FOLLOWER = PathFollower(PATH, speed=0.2, ramp=0.3, gain=4.0)


def test_semicircle_runs_from_end_to_end_over_its_top() -> None:
    assert PATH.length == pytest.approx(np.pi * 0.25)
    np.testing.assert_allclose(PATH.point(0.0), [0.1, -0.2, 0.3])
    np.testing.assert_allclose(PATH.point(PATH.length / 2), [0.1, 0.05, 0.55])
    np.testing.assert_allclose(PATH.point(PATH.length), [0.1, 0.3, 0.3], atol=1e-15)


@pytest.mark.parametrize("s", np.linspace(0.01, 0.77, 7))
def test_tangent_is_the_derivative_by_arc_length(s: float) -> None:
    derivative = difference_jacobian(lambda x: PATH.point(float(x[0])), np.array([s]))[:, 0]
    np.testing.assert_allclose(PATH.tangent(s), derivative, atol=1e-9)
    assert np.linalg.norm(PATH.tangent(s)) == pytest.approx(1.0)


def test_reference_begins_and_ends_at_rest_and_covers_the_path() -> None:
    t = np.linspace(0.0, FOLLOWER.duration, 4001)
    s, speed = np.array([FOLLOWER.progress(float(x)) for x in t]).T
    assert s[0] == 0.0
    assert s[-1] == pytest.approx(PATH.length)
    assert speed[0] == speed[-1] == 0.0
    assert speed.max() == pytest.approx(0.2)
    np.testing.assert_allclose(np.gradient(s, t)[1:-1], speed[1:-1], atol=1e-5)
    # Smooth at the seams: the acceleration of a quintic blend never exceeds 1.875 speed / ramp.
    assert np.abs(np.gradient(speed, t)).max() <= 1.876 * 0.2 / 0.3
    assert FOLLOWER.progress(FOLLOWER.duration + 1.0) == (pytest.approx(PATH.length), 0.0)


def test_follower_pulls_towards_the_reference() -> None:
    pose = np.eye(4)
    pose[:3, 3] = PATH.point(0.0) + np.array([0.01, 0.0, 0.0])
    np.testing.assert_allclose(FOLLOWER.twist(0.0, pose), [-0.04, 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: SemicirclePath(np.zeros(3), np.array([2.0, 0, 0]), np.array([0, 1.0, 0]), 0.1),
            "across: expected a unit",
        ),
        (lambda: SemicirclePath(np.zeros(3), np.array([1.0, 0, 0]), np.array([1.0, 0, 0]), 0.1), "perpendicular"),
        (lambda: SemicirclePath(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), 0.0), "positive radius"),
        (lambda: PathFollower(PATH, speed=0.0, ramp=0.1, gain=1.0), "positive speed"),
        (lambda: PathFollower(PATH, speed=2.0, ramp=3.0, gain=1.0), "path of at least speed x ramp = 6 m, got 0.785"),
    ],
)
def test_impossible_paths_are_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]  # a lambda


class Still:
    def twist(self, t: float, pose: np.ndarray) -> np.ndarray:  # noqa: ARG002  # the interface's arguments
        return np.zeros(6)


def test_nothing_asked_nothing_moves() -> None:
    step = make_step(load_robot("lbr_med14"), "cartesian-error", "fix-orientation", "thesis-active-set")
    q0 = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
    run = simulate(step, Still(), q0, 0.01)
    assert len(run.t) == 10
    assert not run.qd.any()
    np.testing.assert_array_equal(run.q_end, q0)
    assert set(run.status) == {Status.SOLVED}


@pytest.mark.parametrize(("duration", "dt"), [(0.0, 1e-3), (np.nan, 1e-3), (1.0, 0.0), (1.0, -1e-3), (1.0, np.nan)])
def test_impossible_times_are_refused(duration: float, dt: float) -> None:
    step = make_step(load_robot("lbr_med14"), "cartesian-error", "fix-orientation")
    with pytest.raises(ValueError, match=r"^(duration|dt): expected"):
        simulate(step, Still(), np.zeros(7), duration, dt=dt)


def test_every_tick_is_reported() -> None:
    step = make_step(load_robot("lbr_med14"), "cartesian-error", "fix-orientation", "thesis-active-set")
    seen: list[tuple[int, int]] = []
    simulate(step, Still(), np.zeros(7) + 0.5, 0.005, on_tick=lambda done, total: seen.append((done, total)))
    assert seen == [(i, 5) for i in range(1, 6)]


@dataclass(frozen=True)
class Counting(Formulation):
    """Every joint one millimetre or milliradian per second faster than in the tick before."""

    name: ClassVar[str] = "counting"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        qd = qp.variable("qd", tick.nv)
        qp.minimize(qd - (tick.qd_prev + 1e-3))
        qp.command(qd)


@dataclass(frozen=True)
class Recalling(Formulation):
    """The last acceleration, given back as a velocity, and a millimetre or milliradian per second more."""

    name: ClassVar[str] = "recalling"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        qd = qp.variable("qd", tick.nv)
        qp.minimize(qd - (1e-3 * tick.qdd_prev + 1e-3))
        qp.command(qd)


def test_a_step_that_remembers_accelerations_gets_the_last_one() -> None:
    """At rest before: 1, then 1 + 1, then 1 + (2 - 1), then 1 + (2 - 2) millimetres per second."""
    step = make_step(load_robot("lbr_med14"), Recalling(), "free")
    run = simulate(step, Still(), np.zeros(7), 0.004)
    np.testing.assert_allclose(run.qd, np.outer(1e-3 * np.array([1, 2, 2, 1]), np.ones(7)), atol=1e-15)


def test_a_step_that_remembers_gets_the_last_command() -> None:
    step = make_step(load_robot("lbr_med14"), Counting(), "free")
    run = simulate(step, Still(), np.zeros(7), 0.005)
    np.testing.assert_allclose(run.qd, np.outer(1e-3 * np.arange(1, 6), np.ones(7)), atol=1e-15)


def test_a_solver_that_tells_no_iterations_counts_minus_one() -> None:
    step = make_step(load_robot("lbr_med14"), "joint-space", "fix-orientation", solver="qpsolvers:daqp")
    run = simulate(step, FOLLOWER, np.deg2rad([-55.0, 65.0, 10.0, -90.0, -5.0, 30.0, 0.0]), 0.003)
    assert run.iterations.tolist() == [-1] * 3
    assert set(run.status) == {Status.SOLVED}
