"""Joint velocity bounds: against exact fractions, by their defining property, and in simulation."""

import functools

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from kinqp.formulations import BOUNDS, thesis_bound, velocity_bounds, viable_bound
from tests.formulations import reference

SETTINGS = settings(max_examples=150, deadline=None, derandomize=True)
ACCELERATIONS = st.floats(0.1, 1e3)
PERIODS = st.floats(1e-4, 1e-2)
SPEEDS = st.floats(0.01, 50.0)
DISTANCES = st.floats(0.0, 20.0)
HUGE = 1e9  # a qd_max that never bites


@functools.cache
def _function(name: str) -> ca.Function:
    symbols = [ca.SX.sym(letter) for letter in ("d", "v", "a", "dt")]
    return ca.Function(name, symbols, [BOUNDS[name](*symbols)])


@functools.cache
def _interval_function(name: str) -> ca.Function:
    symbols = [ca.SX.sym(letter) for letter in ("q", "q_min", "q_max", "qd_max", "qdd_max", "dt")]
    return ca.Function(name, symbols, list(velocity_bounds(name, *symbols)))


def viable(distance: float, qd_max: float, qdd_max: float, dt: float) -> float:
    return float(_function("viable")(distance, qd_max, qdd_max, dt))


def thesis(distance: float, qd_max: float, qdd_max: float, dt: float) -> float:
    return float(_function("thesis")(distance, qd_max, qdd_max, dt))


def interval(
    name: str, q: float, q_min: float, q_max: float, qd_max: float, qdd_max: float, dt: float
) -> tuple[float, float]:
    low, high = _interval_function(name)(q, q_min, q_max, qd_max, qdd_max, dt)
    return float(low), float(high)


def approach(name: str, distance: float, qd_max: float, qdd_max: float, dt: float) -> tuple[list[float], list[float]]:
    """Drive at the bound for as long as it moves: distances and speeds of all ticks."""
    bound = {"viable": viable, "thesis": thesis}[name]
    distances, speeds = [distance], [bound(distance, qd_max, qdd_max, dt)]
    while distances[-1] > 1e-15 * distance and len(speeds) < 20_000:
        distances.append(distances[-1] - speeds[-1] * dt)
        speeds.append(bound(distances[-1], qd_max, qdd_max, dt))
    return distances, speeds


def test_the_registered_names() -> None:
    assert {"thesis": thesis_bound, "viable": viable_bound} == BOUNDS


@SETTINGS
@given(d=DISTANCES, v=SPEEDS, a=ACCELERATIONS, dt=PERIODS)
def test_viable_equals_the_exact_one(d: float, v: float, a: float, dt: float) -> None:
    # Six operations of 1e-16 each, and up to m/2 of that where delta - m(m+1)/2 cancels: m < 1e6 here, but what
    # cancels is divided by m + 1 again.
    expected = float(reference.exact_viable_bound(d, v, a, dt))
    assert viable(d, v, a, dt) == pytest.approx(expected, rel=1e-14, abs=1e-300)


@SETTINGS
@given(m=st.integers(0, 100_000), a=ACCELERATIONS, dt=PERIODS)
def test_viable_at_triangular_numbers(m: int, a: float, dt: float) -> None:
    """Stopping from m a dt takes m, m - 1, ..., 1 steps of a dt^2: m(m+1)/2 of them."""
    d = m * (m + 1) / 2 * a * dt * dt
    assert viable(d, HUGE, a, dt) == pytest.approx(m * a * dt, rel=1e-12)
    for neighbour in (np.nextafter(d, -1.0), np.nextafter(d, np.inf)):
        assert viable(max(float(neighbour), 0.0), HUGE, a, dt) == pytest.approx(m * a * dt, rel=1e-12, abs=1e-300)


@SETTINGS
@given(d=DISTANCES, a=ACCELERATIONS, dt=PERIODS)
def test_defining_property(d: float, a: float, dt: float) -> None:
    """One tick at the bound leaves a bound that is less by a dt, or zero where less than that is left."""
    b = viable(d, HUGE, a, dt)
    rest = max(d - b * dt, 0.0)
    # d - b dt is exact to half an ulp of d, which the slope of b, at most 1/((m+1) dt), turns into speed.
    slack = np.spacing(d) / dt + 1e-12 * b
    assert viable(rest, HUGE, a, dt) == pytest.approx(max(b - a * dt, 0.0), abs=4 * slack)


@SETTINGS
@given(d=DISTANCES, v=SPEEDS, a=ACCELERATIONS, dt=PERIODS)
def test_the_bound_is_the_largest_speed_that_can_still_stop(d: float, v: float, a: float, dt: float) -> None:
    """Braking by a dt every tick from the bound covers just the distance; qd_max only ever shortens that."""
    b = viable(d, v, a, dt)
    count = int(np.floor(b / (a * dt) * (1.0 - 1e-12)))  # further ticks at which something is left
    stopping = dt * ((count + 1) * b - a * dt * count * (count + 1) / 2)
    assert stopping <= d * (1.0 + 1e-9)
    if b < v:
        assert stopping == pytest.approx(d, rel=1e-9)


@pytest.mark.parametrize("name", ["viable", "thesis"])
@pytest.mark.parametrize("distance", [0.0, -0.0, -1e-17, -1e-3, -5.0, -np.inf])
def test_on_and_beyond_the_limit_nothing_is_left(name: str, distance: float) -> None:
    assert float(_function(name)(distance, 2.0, 10.0, 1e-3)) == 0.0


@pytest.mark.parametrize("name", ["viable", "thesis"])
@pytest.mark.parametrize("distance", [10.0, 1e3, 1e17, 1e300, np.inf])
def test_far_away_and_without_a_limit_it_is_qd_max(name: str, distance: float) -> None:
    assert float(_function(name)(distance, 2.0, 10.0, 1e-3)) == 2.0


@pytest.mark.parametrize("name", ["viable", "thesis"])
@pytest.mark.parametrize("distance", [5e-324, 1e-300, 1e-17, 1e-9])
def test_within_one_tick_of_the_limit_it_is_the_distance_over_dt(name: str, distance: float) -> None:
    assert float(_function(name)(distance, 2.0, 10.0, 1e-3)) == pytest.approx(distance / 1e-3, rel=1e-14)


@pytest.mark.parametrize(
    ("distance", "qd_max", "expected"),
    [
        (0.2, 3.0, 2.0),  # sqrt(2 * 10 * 0.2) = 2
        (0.2, 1.5, 1.5),  # qd_max
        (1e-6, 3.0, 1e-3),  # 1e-6 / 1e-3; the root is 4.5e-3
        (2e-5, 3.0, 2e-2),  # both: d = 2 a dt^2 is where they meet
        (0.0, 3.0, 0.0),
    ],
)
def test_thesis_bound_by_hand(distance: float, qd_max: float, expected: float) -> None:
    assert thesis(distance, qd_max, 10.0, 1e-3) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("distance", "expected"),
    # In units of a dt^2 = 1e-5: 1 -> one tick, m = 1; 3 = 2 + 1 -> m = 2; 4.5 is halfway between 3 and 6 -> 2.5.
    [(1e-5, 0.01), (3e-5, 0.02), (4.5e-5, 0.025), (5e-6, 0.005), (5050e-5, 1.0), (10.0, 3.0)],
)
def test_viable_bound_by_hand(distance: float, expected: float) -> None:
    assert viable(distance, 3.0, 10.0, 1e-3) == pytest.approx(expected, rel=1e-12)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(d=st.floats(1e-6, 2.0), v=st.floats(0.1, 3.0), a=st.floats(2.0, 50.0), dt=st.floats(1e-3, 1e-2))
def test_following_the_viable_bound_lands_on_the_limit(d: float, v: float, a: float, dt: float) -> None:
    distances, speeds = approach("viable", d, v, a, dt)
    assert min(distances) >= -4 * np.spacing(d)
    assert distances[-1] == pytest.approx(0.0, abs=4 * np.spacing(d))
    decelerations = -np.diff(speeds) / dt
    # The last speed is what rounding leaves of zero, over dt again.
    assert decelerations.max() <= a * (1.0 + 1e-9) + np.spacing(d) / dt**2
    assert (np.diff(speeds) <= 1e-12 * v).all()


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    d=st.floats(1e-3, 1.0), v=st.floats(0.1, 3.0), a=st.floats(2.0, 50.0), share=st.floats(0.0, 1.0), seed=st.integers()
)
def test_any_motion_inside_the_viable_bound_stays_inside(d: float, v: float, a: float, share: float, seed: int) -> None:
    """At any speed the bound allows, braking fully is always enough for the next tick's bound."""
    rng, dt = np.random.default_rng(abs(seed)), 1e-3
    speed = share * viable(d, v, a, dt)
    for _ in range(200):
        d -= speed * dt
        assert d >= -1e-15
        bound = viable(d, v, a, dt)
        assert bound >= speed - a * dt * (1.0 + 1e-9)
        speed = min(bound, max(speed, 0.0) + a * dt * rng.uniform(-1.0, 1.0))


def test_sampled_thesis_bound_asks_for_twice_the_acceleration() -> None:
    """From d = 2 a dt^2 the bound is 2 a dt, which lands on the limit in one tick: 2 a. The viable one needs a."""
    a, dt = 10.0, 1e-3
    distances, speeds = approach("thesis", 2 * a * dt**2, 3.0, a, dt)
    assert distances[1] == pytest.approx(0.0, abs=1e-18)
    assert (speeds[0] - speeds[1]) / dt == pytest.approx(2 * a, rel=1e-9)
    for start in (0.1, 0.2, 0.35):
        peak = {
            name: float((-np.diff(approach(name, start, 3.0, a, dt)[1])).max() / dt) for name in ("thesis", "viable")
        }
        assert peak["thesis"] > 1.01 * a
        assert peak["viable"] <= a * (1.0 + 1e-9)


POSITIONS = st.floats(-10.0, 10.0) | st.sampled_from([-1.0, 2.0, np.nextafter(2.0, 0.0), np.nextafter(2.0, 3.0)])


@SETTINGS
@given(name=st.sampled_from(["viable", "thesis"]), q=POSITIONS, v=SPEEDS, a=ACCELERATIONS, dt=PERIODS)
def test_zero_is_inside_and_nothing_exceeds_qd_max(name: str, q: float, v: float, a: float, dt: float) -> None:
    low, high = interval(name, q, -1.0, 2.0, v, a, dt)
    assert -v <= low <= 0.0 <= high <= v


@SETTINGS
@given(name=st.sampled_from(["viable", "thesis"]), q=POSITIONS, v=SPEEDS, a=ACCELERATIONS, dt=PERIODS)
def test_mirror(name: str, q: float, v: float, a: float, dt: float) -> None:
    low, high = interval(name, q, -1.0, 2.0, v, a, dt)
    assert interval(name, -q, -2.0, 1.0, v, a, dt) == (-high, -low)


@SETTINGS
@given(name=st.sampled_from(["viable", "thesis"]), beyond=st.floats(0.0, 100.0), v=SPEEDS, a=ACCELERATIONS, dt=PERIODS)
def test_beyond_a_limit_only_the_way_back_is_open(name: str, beyond: float, v: float, a: float, dt: float) -> None:
    assume(v / (a * dt) < 1e6)
    # So wide that the opposite limit does not count yet: v is reached within v^2/2a + v dt, at most 1e4 + 0.5.
    width = 20_000.0
    assert interval(name, width + beyond, 0.0, width, v, a, dt) == (-v, 0.0)
    assert interval(name, -beyond, 0.0, width, v, a, dt) == (0.0, v)


@pytest.mark.parametrize("name", ["viable", "thesis"])
def test_without_limits_the_interval_is_qd_max_both_ways(name: str) -> None:
    assert interval(name, 1e3, -np.inf, np.inf, 1.5, 10.0, 1e-3) == (-1.5, 1.5)
