"""Joint trajectories: exact ends, limits, times against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinqp.control import CubicStopAndGo, SpiralPath, time_optimal_path, time_optimal_stop_and_go

QD_MAX, QDD_MAX = np.array([1.0, 0.2]), np.array([10.0, 1.0])
POINTS = np.array([[0.0, 0.1], [0.3, 0.02], [0.35, 0.02], [0.1, 0.11], [0.1, 0.11], [0.7, 0.0]])


def test_cubic_is_the_documents() -> None:
    """Its 4 x 4 system, solved for its example: from 30 to 60 in 10 s, at rest at both ends."""
    cubic = CubicStopAndGo(np.array([[30.0], [60.0]]), np.array([0.0, 10.0]))
    system = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [1, 10, 100, 1000], [0, 1, 20, 300]], dtype=float)
    a = np.linalg.solve(system, [30.0, 0.0, 60.0, 0.0])
    np.testing.assert_allclose(cubic.coefficients()[0, :, 0], a, rtol=0.0, atol=1e-12)
    t = np.linspace(0.0, 10.0, 101)
    sampled = cubic.at(t)
    np.testing.assert_allclose(sampled.q[:, 0], np.polynomial.Polynomial(a)(t), rtol=1e-13)
    np.testing.assert_allclose(sampled.qd[:, 0], np.polynomial.Polynomial(a).deriv()(t), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(sampled.qdd[:, 0], np.polynomial.Polynomial(a).deriv(2)(t), rtol=0.0, atol=1e-12)


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=8), st.floats(1e-3, 1e3), st.floats(-1e3, 1e3))
@settings(max_examples=100, deadline=None)
def test_cubic_boundary_conditions_are_exact(values, period, begin) -> None:
    points = np.array(values)[:, None]
    times = begin + period * np.arange(len(values))
    sampled = CubicStopAndGo(points, times).at(times)
    np.testing.assert_array_equal(sampled.q, points)
    np.testing.assert_array_equal(sampled.qd, np.zeros_like(points))


def test_fastest_cubic_meets_a_limit_in_every_move_and_exceeds_none() -> None:
    cubic = CubicStopAndGo.fastest(POINTS, QD_MAX, QDD_MAX)
    for begin, end, way in zip(cubic.times[:-1], cubic.times[1:], np.diff(POINTS, axis=0), strict=True):
        sampled = cubic.at(np.linspace(begin, np.nextafter(end, begin), 201))
        use = max(np.max(np.abs(sampled.qd) / QD_MAX), np.max(np.abs(sampled.qdd) / QDD_MAX))
        assert use <= 1.0 + 1e-9
        if way.any():
            assert use > 0.999


def trapezoid(distance, speed, acceleration) -> float:
    """Shortest time from rest to rest."""
    if distance * acceleration <= speed**2:
        return 2.0 * np.sqrt(distance / acceleration)
    return distance / speed + speed / acceleration


def test_time_optimal_stop_and_go_takes_the_time_of_the_closed_form() -> None:
    moves = np.abs(np.diff(POINTS, axis=0))
    expected = sum(max(trapezoid(d, s, a) for d, s, a in zip(m, QD_MAX, QDD_MAX, strict=True)) for m in moves)
    motion = time_optimal_stop_and_go(POINTS, QD_MAX, QDD_MAX)
    assert motion.t[-1] == pytest.approx(expected, rel=1e-9)
    assert np.all(np.abs(motion.qd) <= QD_MAX * (1.0 + 1e-9))
    assert np.all(np.abs(motion.qdd) <= QDD_MAX * (1.0 + 1e-9))
    np.testing.assert_allclose(motion.q[[0, -1]], POINTS[[0, -1]], rtol=0.0, atol=1e-12)
    gaps = [np.min(np.linalg.norm(motion.q - point, axis=1)) for point in POINTS]
    assert max(gaps) < 1e-5  # a sample is less than 1 ms from the stop


def test_time_optimal_path_on_a_straight_line_takes_the_time_of_the_closed_form() -> None:
    line = np.linspace([0.0, 0.0], [0.9, 0.1], 12)
    expected = trapezoid(1.0, min(QD_MAX / [0.9, 0.1]), min(QDD_MAX / [0.9, 0.1]))
    motion = time_optimal_path(line, QD_MAX, QDD_MAX)
    assert motion.t[-1] >= expected * (1.0 - 1e-4)
    assert motion.t[-1] == pytest.approx(expected, rel=0.02)


def test_time_optimal_path_keeps_limits_goes_through_the_points_and_beats_stopping() -> None:
    motion = time_optimal_path(POINTS, QD_MAX, QDD_MAX)
    assert np.all(np.abs(motion.qd) <= QD_MAX * (1.0 + 1e-9))
    assert np.all(np.abs(motion.qdd) <= QDD_MAX * (1.0 + 1e-9))
    np.testing.assert_array_equal(motion.qd[[0, -1]], 0.0)
    gaps = [np.min(np.linalg.norm(motion.q - point, axis=1)) for point in POINTS]
    assert max(gaps) < 2e-3
    np.testing.assert_allclose(motion.q[[0, -1]], POINTS[[0, -1]], rtol=0.0, atol=1e-12)
    # Its velocity is the derivative of its position, its acceleration bounded between samples too.
    h = np.diff(motion.t)[:, None]
    mean = 0.5 * (motion.qd[1:] + motion.qd[:-1])
    assert np.max(np.abs(np.diff(motion.q, axis=0) / h - mean)[:-1]) < 0.5 * 10.0 * float(h[0, 0])
    assert np.all(np.abs(np.diff(motion.qd, axis=0) / h)[:-1] <= 1.1 * QDD_MAX)


def test_not_stopping_is_faster_along_a_smooth_path() -> None:
    phase = np.linspace(0.0, 5.0, 40)
    smooth = np.column_stack([0.5 * np.sin(phase), 0.1 * np.cos(phase)])
    through = time_optimal_path(smooth, QD_MAX, QDD_MAX).t[-1]
    assert through < 0.6 * time_optimal_stop_and_go(smooth, QD_MAX, QDD_MAX).t[-1]
    # No faster than the joint that has the longest way at its full speed.
    assert through > np.max(np.abs(np.diff(smooth, axis=0)).sum(axis=0) / QD_MAX)


@pytest.mark.parametrize("plan", [time_optimal_stop_and_go, time_optimal_path])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((POINTS * np.nan, QD_MAX, QDD_MAX), r"^points: expected"),
        ((POINTS[:1], QD_MAX, QDD_MAX), r"^points: expected"),
        ((POINTS, QD_MAX[:1], QDD_MAX), r"^qd_max: expected shape"),
        ((POINTS, QD_MAX, -QDD_MAX), r"^qdd_max: expected positive"),
    ],
)
def test_bad_input(plan, arguments, message) -> None:
    with pytest.raises(ValueError, match=message):
        plan(*arguments)


def test_bad_cubics() -> None:
    with pytest.raises(ValueError, match=r"^times: expected 2 increasing"):
        CubicStopAndGo(np.zeros((2, 1)), np.zeros(2))
    with pytest.raises(ValueError, match=r"^points: expected at least 2 rows"):
        CubicStopAndGo(np.zeros((1, 1)), np.zeros(1))


def test_spiral_is_the_documents() -> None:
    """Its equation at t = -0.8, 0 and 1.3; tangent and length by differences."""
    spiral = SpiralPath((0.23, 0.2, -0.0145), 0.02, 0.75e-3, -1.6 * np.pi, 2.6 * np.pi)
    t = np.array([-0.8, 1.3])
    expected = [230 + 20 * np.cos(2 * np.pi * t), 200 + 20 * np.sin(2 * np.pi * t), -14.5 + 0.75 * 2 * np.pi * t]
    np.testing.assert_allclose(1e3 * spiral.points(148)[[0, -1]], np.column_stack(expected), rtol=1e-12)
    dense = spiral.points(20_001)
    assert np.linalg.norm(np.diff(dense, axis=0), axis=1).sum() == pytest.approx(spiral.length, rel=1e-7)
    s, h = 0.07, 1e-6
    slope = (spiral.point(s + h) - spiral.point(s - h)) / (2 * h)
    np.testing.assert_allclose(spiral.tangent(s), slope, rtol=0.0, atol=1e-8)
    with pytest.raises(ValueError, match=r"^spiral: expected a positive radius"):
        SpiralPath((0.0, 0.0, 0.0), -1.0, 0.0, 0.0, 1.0)
    with pytest.raises(ValueError, match=r"^count: expected"):
        spiral.points(1)
