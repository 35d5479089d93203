"""Closest points of segments: worked out by hand, against coal, and where they are not unique."""

from __future__ import annotations

import casadi as ca
import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from kinqp.formulations.constraints.closest_points import Segment, closest_points, direction

Array = NDArray[np.float64]


def _compiled(first_point: bool, second_point: bool) -> ca.Function:
    p, u, q, w = (ca.SX.sym(name, 3) for name in "puqw")
    first, second = Segment(p, None if first_point else u), Segment(q, None if second_point else w)
    P, Q = closest_points(first, second)
    n = direction(P, Q, first.along, second.along)
    return ca.Function("closest", [p, u, q, w], [P, Q, n])


SEGMENTS = _compiled(False, False)
POINTS = {(a, b): _compiled(a, b) for a in (False, True) for b in (False, True)}


def closest(p: object, u: object, q: object, w: object) -> tuple[Array, Array, Array, float]:
    P, Q, n = (np.asarray(value)[:, 0] for value in SEGMENTS(p, u, q, w))
    return P, Q, n, float(np.linalg.norm(P - Q))


@pytest.mark.parametrize(
    ("segments", "P", "Q"),
    [
        # Crossing at right angles, 2 apart.
        (([-1, 0, 0], [2, 0, 0], [0, -1, 2], [0, 2, 0]), [0, 0, 0], [0, 0, 2]),
        # End to end on one line.
        (([0, 0, 0], [1, 0, 0], [3, 0, 0], [1, 0, 0]), [1, 0, 0], [3, 0, 0]),
        # Interior of the first, end of the second.
        (([-1, 0, 0], [2, 0, 0], [0.5, 1, 0], [0, 3, 0]), [0.5, 0, 0], [0.5, 1, 0]),
        # End of the first, interior of the second.
        (([0.5, 1, 0], [0, 3, 0], [-1, 0, 0], [2, 0, 0]), [0.5, 1, 0], [0.5, 0, 0]),
        # Parallel, facing along [1, 2]: the middle.
        (([0, 0, 0], [2, 0, 0], [1, 1, 0], [3, 0, 0]), [1.5, 0, 0], [1.5, 1, 0]),
        # The same, against each other.
        (([0, 0, 0], [2, 0, 0], [4, 1, 0], [-3, 0, 0]), [1.5, 0, 0], [1.5, 1, 0]),
        # Parallel, past each other.
        (([0, 0, 0], [1, 0, 0], [3, 1, 0], [2, 0, 0]), [1, 0, 0], [3, 1, 0]),
        # Without length at run time.
        (([0, 0, 1], [0, 0, 0], [-1, 0, 0], [2, 0, 0]), [0, 0, 1], [0, 0, 0]),
        (([-1, 0, 0], [2, 0, 0], [0.25, 0, 1], [0, 0, 0]), [0.25, 0, 0], [0.25, 0, 1]),
        (([0, 0, 1], [0, 0, 0], [0, 0, 3], [0, 0, 0]), [0, 0, 1], [0, 0, 3]),
    ],
)
def test_golden(segments: tuple[list[float], ...], P: list[float], Q: list[float]) -> None:
    got_P, got_Q, n, distance = closest(*segments)
    np.testing.assert_allclose(got_P, P, atol=1e-15)
    np.testing.assert_allclose(got_Q, Q, atol=1e-15)
    np.testing.assert_allclose(n, (np.array(P) - Q) / distance, atol=1e-15)


@pytest.mark.parametrize(
    ("segments", "normal"),
    [
        # Crossing: the common normal, x cross y.
        (([-1, 0, 0], [2, 0, 0], [0, -1, 0], [0, 2, 0]), [0, 0, 1]),
        # The same segment twice, and a point on itself: the vertical.
        (([0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 0]), [0, 0, 1]),
        (([0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]), [0, 0, 1]),
    ],
)
def test_coincident_points_have_a_direction(segments: tuple[list[float], ...], normal: list[float]) -> None:
    *_, n, distance = closest(*segments)
    assert distance == 0.0
    np.testing.assert_allclose(np.abs(n), normal, atol=1e-15)


def coal_distance(p: Array, u: Array, q: Array, w: Array, radius: float = 1e-3) -> float:
    shapes = []
    for start, along in ((p, u), (q, w)):
        length = float(np.linalg.norm(along))
        turned = coal.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along / length)
        shapes += [coal.Capsule(radius, length), coal.Transform3s(turned.toRotationMatrix(), start + along / 2)]
    return float(coal.distance(*shapes, coal.DistanceRequest(), coal.DistanceResult())) + 2 * radius


@pytest.mark.parametrize("spread", [1.0, 1e-3, 1e-6, 1e-9, 0.0])
def test_distance_is_proved_and_coals(spread: float) -> None:
    """Random segments, and nearly parallel ones: the second's direction differs from the first's by `spread`.

    The proof: moving either point towards an end of its segment does not bring them closer, and the distance of two
    segments is convex. coal itself misses the nearest points of nearly parallel segments by up to 1e-7 m.
    """
    rng = np.random.default_rng(0)
    for _ in range(400):
        p, q, u = rng.uniform(-1, 1, (3, 3))
        w = u * rng.choice([-1.0, 1.0]) + spread * rng.normal(size=3)
        P, Q, n, distance = closest(p, u, q, w)
        gains = [n @ (p - P), n @ (p + u - P), -n @ (q - Q), -n @ (q + w - Q)]
        assert min(gains) >= -1e-12
        if distance > 0.01:
            referee = coal_distance(p, u, q, w)
            assert distance <= referee + 1e-12
            assert distance >= referee - (1e-9 if spread >= 1e-3 else 1e-6)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.sampled_from([-1.0, -0.5, 0.0, 1e-13, 1e-8, 0.5, 1.0, 2.0]), min_size=12, max_size=12))
def test_no_other_points_are_closer(values: list[float]) -> None:
    """Also for the degenerate: parallel, touching, without length. Against a grid of points, and symmetric."""
    p, u, q, w = np.array(values).reshape(4, 3)
    P, Q, n, distance = closest(p, u, q, w)
    assert np.isfinite([*P, *Q, *n]).all()
    assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-9)
    grid = np.linspace(0, 1, 11)
    others = (p + grid[:, None] * u)[:, None, :] - (q + grid[:, None] * w)[None, :, :]
    assert distance <= np.linalg.norm(others, axis=-1).min() + 1e-12
    *_, backwards = closest(q, w, p, u)
    assert backwards == pytest.approx(distance, abs=1e-12)


def test_points_and_segments_agree_with_segments_of_no_length() -> None:
    rng = np.random.default_rng(1)
    for (first, second), function in POINTS.items():
        for _ in range(50):
            p, u, q, w = rng.uniform(-1, 1, (4, 3))
            got = function(p, u, q, w)
            wanted = SEGMENTS(p, 0 * u if first else u, q, 0 * w if second else w)
            for a, b in zip(got, wanted, strict=True):
                np.testing.assert_allclose(a, b, atol=1e-13)
