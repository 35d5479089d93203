"""Joint acceleration bounds and the safe stop: by hand, by their defining property, and on 100,000 states."""

import functools

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from kinqp.formulations import acceleration_bounds, braking, velocity_bounds

Array = NDArray[np.float64]
SETTINGS = settings(max_examples=150, deadline=None, derandomize=True)
NAMES = ("qd_prev", "q", "q_min", "q_max", "qd_max", "qdd_max", "dt")
A, DT = 10.0, 1e-3


@functools.cache
def _function(name: str, count: int) -> ca.Function:
    """qd_lo, qd_hi, qdd_lo, qdd_hi of one joint, for `count` joints at once."""
    qd_prev, q, q_min, q_max, qd_max, qdd_max, dt = symbols = [ca.SX.sym(letter) for letter in NAMES]
    qd_lo, qd_hi = velocity_bounds(name, q, q_min, q_max, qd_max, qdd_max, dt)
    bounds = acceleration_bounds(qd_prev, qd_lo, qd_hi, qdd_max, dt)
    return ca.Function(name, symbols, [qd_lo, qd_hi, *bounds]).map(count)


def bounds_of(joints: dict[str, Array], name: str = "viable") -> list[Array]:
    count = len(joints["q"])
    rows = [ca.DM(np.broadcast_to(joints[letter], (1, count))) for letter in NAMES]
    return [np.array(row)[0] for row in _function(name, count)(*rows)]


def joints_at_random(count: int, rng: np.random.Generator) -> dict[str, Array]:
    """Random limits; positions inside, on a limit, a hair from it; some joints without limits."""
    q_max = rng.uniform(0.01, 3.0, count)
    q_min = q_max - rng.choice([1e-9, 1e-4, 1e-2, 1.0, 6.0], count)
    side = np.where(rng.random(count) < 0.5, q_min, q_max)
    inwards = np.where(side == q_min, 1.0, -1.0)
    offset = rng.choice([0.0, 1e-17, 1e-9, 1e-6, 1e-5, 3e-5, 1e-3, 0.1], count)
    q = np.where(rng.random(count) < 0.5, rng.uniform(q_min, q_max), np.clip(side + inwards * offset, q_min, q_max))
    unlimited = rng.random(count) < 0.1
    return {
        "q": q,
        "q_min": np.where(unlimited, -np.inf, q_min),
        "q_max": np.where(unlimited, np.inf, q_max),
        "qd_max": rng.uniform(0.01, 5.0, count),
        "qdd_max": rng.choice([0.5, 10.0, 300.0], count),
        "dt": rng.choice([1e-4, 1e-3, 1e-2], count),
    }


def check_consistency(count: int, ticks: int, seed: int) -> None:
    """Once inside, always inside: whatever is chosen within the bounds, the next ones are there within qdd_max."""
    rng = np.random.default_rng(seed)
    joints = joints_at_random(count, rng)
    a, dt = joints["qdd_max"], joints["dt"]
    low, high, _, _ = bounds_of(joints | {"qd_prev": np.zeros(count)})
    # Admissible: a command within the velocity bounds of where it was given; on them as often as anywhere between.
    qd = low + (high - low) * rng.choice([0.0, 1.0, np.nan], count)
    qd = np.where(np.isnan(qd), rng.uniform(low, high), qd)
    for _ in range(ticks):
        joints["q"] = joints["q"] + dt * qd
        assert (joints["q"] <= joints["q_max"] + 1e-15).all()
        assert (joints["q"] >= joints["q_min"] - 1e-15).all()
        low, high, qdd_lo, qdd_hi = bounds_of(joints | {"qd_prev": qd})
        # What rounding of q, 4e-16, does to a bound is 4e-16/dt, and to an acceleration that over dt again.
        slack = 1e-9 * a + 1e-15 / dt**2
        assert (qdd_lo <= qdd_hi).all()
        assert (qdd_lo >= -a - slack).all()
        assert (qdd_hi <= a + slack).all()
        assert (qd + dt * qdd_lo >= low - 1e-14).all()
        assert (qd + dt * qdd_hi <= high + 1e-14).all()
        # All of the intersection, not just some of it.
        np.testing.assert_allclose(qd + dt * qdd_lo, np.maximum(low, qd - a * dt), atol=1e-11)
        np.testing.assert_allclose(qd + dt * qdd_hi, np.minimum(high, qd + a * dt), atol=1e-11)
        choice = rng.choice([0.0, 1.0, 0.5], count)
        qd = qd + dt * (qdd_lo + choice * (qdd_hi - qdd_lo))


def test_once_inside_always_inside() -> None:
    check_consistency(100_000, 4, 0)
    check_consistency(1_000, 150, 1)


@pytest.mark.long
def test_once_inside_always_inside_for_long() -> None:
    check_consistency(100_000, 1000, 2)


def test_zero_velocity_is_reached_at_full_braking() -> None:
    rng = np.random.default_rng(3)
    joints = joints_at_random(2_000, rng)
    a, dt = joints["qdd_max"], joints["dt"]
    low, high, _, _ = bounds_of(joints | {"qd_prev": np.zeros(2_000)})
    qd = rng.uniform(low, high)
    needed = np.ceil(np.abs(qd) / (a * dt) * (1.0 - 1e-12))
    kept = needed < 250
    joints = {name: value[kept] for name, value in joints.items()}
    qd, a, dt, needed = qd[kept], a[kept], dt[kept], needed[kept]
    for tick in range(250):
        joints["q"] = joints["q"] + dt * qd
        _, _, qdd_lo, qdd_hi = bounds_of(joints | {"qd_prev": qd})
        qd = qd + dt * np.clip(-qd / dt, qdd_lo, qdd_hi)
        stopped = tick + 1 >= needed
        assert np.abs(qd[stopped]).max(initial=0.0) <= 1e-12
    assert needed.max() > 150


@SETTINGS
@given(
    q=st.floats(-3.0, 3.0),
    qd=st.floats(-10.0, 10.0),
    v=st.floats(0.01, 5.0),
    a=st.floats(0.1, 300.0),
    dt=st.floats(1e-4, 1e-2),
    name=st.sampled_from(["viable", "thesis"]),
)
def test_position_and_velocity_come_first(q: float, qd: float, v: float, a: float, dt: float, name: str) -> None:
    """From any state: never crossed, within the velocity bounds, and as close to qdd_max as those permit."""
    joint = {"q": q, "q_min": -1.0, "q_max": 2.0, "qd_max": v, "qdd_max": a, "dt": dt, "qd_prev": qd}
    low, high, qdd_lo, qdd_hi = (
        float(x[0]) for x in bounds_of({key: np.array([value]) for key, value in joint.items()}, name)
    )
    slow, fast = qd + dt * qdd_lo, qd + dt * qdd_hi
    slack = 1e-12 * max(1.0, abs(qd))
    assert low - slack <= slow <= fast + slack <= high + 2 * slack
    if qd - a * dt > high:
        assert slow == pytest.approx(high, abs=slack)
        assert fast == pytest.approx(high, abs=slack)
    elif qd + a * dt < low:
        assert slow == pytest.approx(low, abs=slack)
        assert fast == pytest.approx(low, abs=slack)
    else:
        assert slow >= qd - a * dt - slack
        assert fast <= qd + a * dt + slack


@pytest.mark.parametrize(
    ("q", "qd", "lower", "upper"),
    [
        (0.0, 0.0, -10.0, 10.0),  # in the middle, at rest: the acceleration limit
        (0.0, 1.995, -10.0, 5.0),  # 5 mrad/s below qd_max = 2
        (1.0, 0.0, -10.0, 0.0),  # on the limit, at rest
        (1.0 - 1e-5, 0.0, -10.0, 10.0),  # from a dt^2 away a dt is the bound: it lands on the limit
        (1.0 - 5e-6, 0.0, -10.0, 5.0),
        (1.0 - 1e-5, 0.02, -10.0, -10.0),  # just what full braking still does
        (1.0 - 1e-5, 0.03, -20.0, -20.0),  # too fast: the position limit holds, with twice the acceleration
        (1.1, 0.5, -500.0, -500.0),  # beyond the limit and outwards: stopped at once
        (1.1, -0.5, -10.0, 10.0),  # beyond it, on the way back
    ],
)
def test_bounds_by_hand(q: float, qd: float, lower: float, upper: float) -> None:
    joint = {"q": q, "q_min": -1.0, "q_max": 1.0, "qd_max": 2.0, "qdd_max": A, "dt": DT, "qd_prev": qd}
    _, _, qdd_lo, qdd_hi = bounds_of({key: np.array([value]) for key, value in joint.items()})
    assert qdd_lo[0] == pytest.approx(lower, abs=1e-7)
    assert qdd_hi[0] == pytest.approx(upper, abs=1e-7)


# No joint of these tests has a velocity limit below this [rad/s].
FASTEST = 20.0


@functools.cache
def _braking(nv: int) -> ca.Function:
    symbols = [ca.SX.sym(letter, nv) for letter in ("qd_prev", "qd_lo", "qd_hi", "qdd_max")]
    last, low, high, a = symbols
    return ca.Function("braking", symbols, [braking(last, low, high, ca.SX.ones(nv) * FASTEST, a, ca.SX(DT))])


def brake(qd: Array, low: Array | float, high: Array | float, a: Array | float = A) -> Array:
    return np.array(_braking(len(qd))(qd, low, high, a))[:, 0]


def test_braking_by_hand() -> None:
    wide = (-5.0, 5.0)
    np.testing.assert_allclose(brake(np.array([1.0, -0.5, 0.0]), *wide), [0.99, -0.495, 0.0], atol=1e-15)
    # The last joint has less to brake with: it decides. 1 - 1e-3/0.5 = 0.998.
    slow = brake(np.array([1.0, -0.5, 0.5]), *wide, np.array([10.0, 10.0, 1.0]))
    np.testing.assert_allclose(slow, [0.998, -0.499, 0.499], atol=1e-15)
    # Less than one tick's worth is left: zero, and rest stays rest.
    np.testing.assert_array_equal(brake(np.array([0.01, -0.003, 0.0]), *wide), np.zeros(3))
    np.testing.assert_array_equal(brake(np.zeros(3), *wide), np.zeros(3))
    # A joint on its braking curve brakes as it must, the others as before.
    high = np.array([5.0, 5.0, 0.19])
    np.testing.assert_allclose(brake(np.array([1.0, -0.5, 0.2]), -5.0, high), [0.99, -0.495, 0.19], atol=1e-15)


def test_a_brake_goes_by_its_acceleration_limits_first() -> None:
    # At 1 rad/s where 0.5 is the most: braked to it at 10 rad/s^2, and no faster. Beyond all limits: from the limit.
    np.testing.assert_allclose(brake(np.array([1.0]), -0.5, 0.5), [0.99], atol=1e-15)
    np.testing.assert_allclose(brake(np.array([1e9, -1e300]), -30.0, 30.0), [19.99, -19.99], atol=1e-12)
    np.testing.assert_array_equal(brake(np.array([1.0, -2.0]), -5.0, 5.0, np.full(2, np.inf)), np.zeros(2))


def test_braking_stops_every_joint_at_once_and_as_soon_as_possible() -> None:
    rng = np.random.default_rng(4)
    for _ in range(10):
        qd, a = rng.normal(size=7), rng.uniform(1.0, 20.0, 7)
        needed = int(np.ceil((np.abs(qd) / a).max() / DT * (1.0 - 1e-12)))
        direction = qd / np.linalg.norm(qd)
        for _ in range(needed):
            assert qd.any()
            after = brake(qd, -10.0, 10.0, a)
            assert (np.abs(after - qd) <= a * DT * (1.0 + 1e-9)).all()
            np.testing.assert_allclose(after, direction * np.linalg.norm(after), atol=1e-12)
            qd = after
        np.testing.assert_allclose(qd, 0.0, atol=1e-12)


def test_braking_from_an_admissible_state_is_admissible() -> None:
    """Within the velocity bounds, no joint beyond its acceleration limit, until at rest, for seven coupled joints."""
    rng = np.random.default_rng(5)
    count = 300
    joints = joints_at_random(7 * count, rng) | {"dt": np.full(7 * count, DT)}
    low, high, _, _ = bounds_of(joints | {"qd_prev": np.zeros(7 * count)})
    qd, a = rng.uniform(low, high), joints["qdd_max"]
    function = _braking(7).map(count)
    for _ in range(100):
        joints["q"] = joints["q"] + DT * qd
        low, high, _, _ = bounds_of(joints | {"qd_prev": qd})
        columns = [ca.DM(x.reshape(count, 7).T) for x in (qd, low, high, a)]
        after = np.array(function(*columns)).T.reshape(-1)
        assert (after <= high + 1e-12).all()
        assert (after >= low - 1e-12).all()
        assert (np.abs(after - qd) <= a * DT * (1.0 + 1e-9) + 1e-12).all()
        qd = after
