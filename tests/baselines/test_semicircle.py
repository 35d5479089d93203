"""The thesis's A, B and C on its experiment (5.3): what each is known for, in numbers, and docs/baselines.md."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from kinqp.baselines import available_baselines
from kinqp.benchmarks import Scenario, get_scenario
from kinqp.control import Trajectory, make_step, simulate
from kinqp.solvers import Status

ELBOW = 3
PAGE = Path(__file__).parents[2] / "docs" / "baselines.md"
A, B, C = "task-priority", "saturation-null-space", "cartesian-error"


@cache
def scenario() -> Scenario:
    return get_scenario("semicircle")


@cache
def run(method: str) -> Trajectory:
    s = scenario()
    return simulate(make_step(s.robot, method, s.mode), s.guide, s.q0, s.duration, dt=s.dt)


def elbow_distance(trajectory: Trajectory) -> np.ndarray:
    return np.append(trajectory.q[:, ELBOW], trajectory.q_end[ELBOW]) - scenario().robot.q_min[ELBOW]


def elbow_peak(method: str) -> float:
    return float(np.abs(run(method).acceleration()[:, ELBOW]).max())


def speed(trajectory: Trajectory) -> np.ndarray:
    return np.linalg.norm(trajectory.v + trajectory.eps, axis=1)


def standing(method: str) -> np.ndarray:
    """Ticks at which the hand pulls and nothing moves."""
    trajectory = run(method)
    asked = np.linalg.norm(trajectory.v, axis=1)
    return (asked > 1e-2) & (speed(trajectory) < 1e-3 * asked)


def left_over(method: str) -> float:
    """Distance from the end of the path at the end of the run."""
    s = scenario()
    return float(np.linalg.norm(s.robot.pose(run(method).q_end)[:3, 3] - s.guide.path.point(s.guide.path.length)))


@pytest.mark.parametrize("method", [A, B, C])
def test_all_three_hold_the_limit_and_the_locked_rows(method: str) -> None:
    assert set(run(method).status) == {Status.SOLVED}
    assert elbow_distance(run(method)).min() >= -4.5e-16
    assert run(method).fixed_error.max() <= 1e-9


def test_a_slides_but_its_elbow_stops_within_one_period() -> None:
    trajectory = run(A)
    # The elbow comes at full speed and is frozen at once: v/dt, and so it is when it comes off.
    acceleration = np.abs(trajectory.acceleration()[:, ELBOW])
    hit = int(np.argmax(acceleration))
    assert trajectory.qd[hit, ELBOW] == 0.0
    assert acceleration[hit] == pytest.approx(abs(trajectory.qd[hit - 1, ELBOW]) / scenario().dt)
    assert acceleration[hit] > 15.0 * scenario().robot.qdd_max[ELBOW]
    assert 0.0 <= elbow_distance(trajectory).min() < abs(trajectory.qd[hit - 1, ELBOW]) * scenario().dt
    assert not standing(A).any()
    assert left_over(A) < 1e-3
    assert trajectory.bound_violation.max() > 0.1
    assert any("a joint exceeds its velocity bound" in message for message in trajectory.message)


@pytest.mark.parametrize("variant", [B, pytest.param(f"{B}(variant=optimal)", marks=pytest.mark.long)])
def test_b_is_smooth_but_stands_still_at_the_limit(variant: str) -> None:
    assert elbow_peak(variant) <= 1.01 * scenario().robot.qdd_max[ELBOW]
    assert standing(variant).mean() > 0.4
    first = int(np.flatnonzero(standing(variant))[0])
    assert elbow_distance(run(variant))[first] < 1e-9
    assert left_over(variant) > 0.3, "it never gets on"
    assert run(variant).bound_violation.max() <= 1e-12


def test_c_slides_and_never_exceeds_the_acceleration_limit() -> None:
    acceleration = np.abs(run(C).acceleration())
    assert (acceleration <= 1.01 * scenario().robot.qdd_max).all()
    assert not standing(C).any()
    assert left_over(C) < 1e-3


@pytest.mark.long
def test_the_others_do_what_their_docstrings_say() -> None:
    qdd_max = scenario().robot.qdd_max[ELBOW]
    assert elbow_distance(run("gradient-projection")).min() < -0.05, "nothing keeps it from passing the limit"
    assert elbow_peak("geometric-clamping") > 15.0 * qdd_max
    assert elbow_distance(run("geometric-clamping")).min() >= 0.0
    assert elbow_peak("weighted-least-norm") > 15.0 * qdd_max
    assert -2e-4 < elbow_distance(run("weighted-least-norm")).min() < 0.0, "past it by less than a period's way"
    assert run("progressive-clamping").fixed_error.max() > 0.1
    assert run("task-augmentation").fixed_error.max() > 1e-3
    np.testing.assert_allclose(run("null-space-compensation").qd, run(B).qd, atol=1e-9)
    np.testing.assert_allclose(run("geometric-scaling").qd, run(C).qd, atol=1e-9)  # one joint over: the same


def figures(method: str) -> list[float]:
    """Columns of the page's table."""
    trajectory, s = run(method), scenario()
    acceleration = np.abs(trajectory.acceleration())
    return [
        elbow_peak(method),
        float(np.max(acceleration / s.robot.qdd_max)),
        1e3 * float(elbow_distance(trajectory).min()),
        100.0 * float(standing(method).mean()),
        1e3 * left_over(method),
        float(trajectory.fixed_error.max()),
        float(trajectory.bound_violation.max()),
    ]


def printed() -> dict[str, list[str]]:
    rows = re.findall(r"^\| (?:[ABC] )?`([^`]+)` \|(.*)\|$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {name: cells.split("|") for name, cells in rows if cells.count("|") == 6}


def check_page(method: str) -> None:
    measured = figures(method)
    for shown, value in zip(printed()[method], measured, strict=True):
        last_digit = 10.0 ** -len(shown.strip().partition(".")[2])
        assert float(shown) == pytest.approx(value, rel=0.02, abs=last_digit), (method, measured)


@pytest.mark.parametrize("method", [A, B, C])
def test_the_page_shows_these_numbers(method: str) -> None:
    check_page(method)


@pytest.mark.long
def test_the_page_shows_the_numbers_of_all_methods() -> None:
    assert {*available_baselines(), C} <= set(printed())
    for method in printed():
        check_page(method)
