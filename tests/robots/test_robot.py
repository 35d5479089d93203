"""The data of a robot: limits, input checks, copies, registration."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import kinqp.robots.registry
from kinqp.robots import Robot, RobotError, available_robots, finite_vector, load_robot
from tests.robots.arms import ARMS, arm, example_urdf

_ARRAYS = ("q_min", "q_max", "qd_max", "qdd_max", "tau_max")


def test_registered_limits_are_the_published_ones() -> None:
    position = np.radians([170, 120, 170, 120, 170, 120, 175])
    for name, speed, torque in (
        ("lbr_med14", [85, 85, 100, 75, 130, 135, 135], [320, 320, 176, 176, 110, 40, 40]),
        ("lbr_med7", [98, 98, 100, 130, 140, 180, 180], [176, 176, 110, 110, 110, 40, 40]),
    ):
        robot = load_robot(name)
        assert (robot.name, robot.tip, robot.nv) == (name, "flange", 7)
        assert robot.joint_names == ("A1", "A2", "A3", "A4", "A5", "A6", "A7")
        np.testing.assert_array_equal(robot.q_max, position)
        np.testing.assert_array_equal(robot.q_min, -position)
        np.testing.assert_array_equal(robot.qd_max, np.radians(speed))
        np.testing.assert_array_equal(robot.tau_max, torque)
        np.testing.assert_array_equal(robot.qdd_max, np.full(7, 10.0))
        assert robot.has_inertia
    robot = load_robot("ur5e")
    np.testing.assert_array_equal(robot.q_max, np.radians([360, 360, 180, 360, 360, 360]))
    np.testing.assert_array_equal(robot.q_min, -robot.q_max)
    np.testing.assert_array_equal(robot.qd_max, np.full(6, np.pi))
    np.testing.assert_array_equal(robot.tau_max, [150, 150, 150, 28, 28, 28])
    robot = load_robot("davinci5", tip="tool")
    np.testing.assert_array_equal(robot.q_min, [0, 0, np.radians(-90), np.radians(90), 0])
    np.testing.assert_array_equal(robot.q_max, [np.radians(60), 0.2, np.radians(-30), np.radians(135), np.radians(30)])
    np.testing.assert_array_equal(robot.qdd_max, [10, 1, 10, 10, 10])
    np.testing.assert_array_equal(robot.tau_max, np.full(5, np.inf))


@pytest.mark.parametrize(
    ("name", "masses"),
    [
        ("lbr_med14", [5.76, 6.35, 3.5, 3.5, 3.5, 1.8, 1.2]),
        ("lbr_med7", [4, 4, 3, 2.7, 1.7, 1.8, 0.3]),
        ("ur5e", [3.761, 8.058, 2.846, 1.37, 1.3, 0.365]),
    ],
)
def test_masses_are_the_published_ones(name: str, masses: list[float]) -> None:
    assert [body.mass for body in list(load_robot(name).model.inertias)[1:]] == pytest.approx(masses, rel=1e-15)


def test_upright_lbr_carries_its_weight_on_no_joint() -> None:
    # Centres of mass lie off the axes by centimetres only, so the torque is small but for A2, A4 and A6 not
    # zero.
    torque = load_robot("lbr_med14").bias_forces(np.zeros(7), np.zeros(7))
    np.testing.assert_allclose(torque[[0, 2, 4, 6]], 0.0, atol=1e-12)
    assert np.max(np.abs(torque)) < 2.0


@pytest.mark.parametrize("name", ARMS)
def test_arrays_have_one_entry_per_joint_and_cannot_be_written(name: str) -> None:
    robot = arm(name)
    for field in _ARRAYS:
        array = getattr(robot, field)
        assert array.shape == (robot.nv,)
        assert array.dtype == np.float64
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        robot.name = "other"  # type: ignore[misc] # what the test is about


def test_example_arms_have_the_expected_joints() -> None:
    assert [arm(name).nv for name in ("panda", "ur5", "so101", "kinova")] == [7, 6, 5, 6]
    kinova = arm("kinova")
    assert kinova.model.nq == 9
    np.testing.assert_array_equal(np.isinf(kinova.q_min), [True, False, False, True, False, True])
    np.testing.assert_array_equal(np.isinf(kinova.q_max), np.isinf(kinova.q_min))


def test_continuous_joint_is_its_angle() -> None:
    kinova = arm("kinova")
    q = np.array([0.3, 2.0, 3.0, -4.0, 1.0, 100.0])
    np.testing.assert_array_equal(
        kinova.to_pinocchio(q),
        [np.cos(0.3), np.sin(0.3), 2.0, 3.0, np.cos(-4.0), np.sin(-4.0), 1.0, np.cos(100.0), np.sin(100.0)],
    )
    around = q + 2.0 * np.pi * np.array([1, 0, 0, -3, 0, 2])
    np.testing.assert_allclose(kinova.pose(around), kinova.pose(q), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("name", ARMS)
def test_random_configurations_fill_the_limits(name: str) -> None:
    robot = arm(name)
    rng = np.random.default_rng(8)
    drawn = np.array([robot.random_configuration(rng) for _ in range(500)])
    low, high = np.maximum(robot.q_min, -np.pi), np.minimum(robot.q_max, np.pi)
    low = np.where(np.isinf(robot.q_min), low, robot.q_min)
    high = np.where(np.isinf(robot.q_max), high, robot.q_max)
    assert (drawn >= low).all()
    assert (drawn <= high).all()
    assert (np.ptp(drawn, axis=0) > 0.95 * (high - low)).all()
    again = robot.random_configuration(np.random.default_rng(8))
    np.testing.assert_array_equal(again, drawn[0])


def _same(one: Robot, other: Robot) -> None:
    q = one.random_configuration(np.random.default_rng(9))
    assert (one.name, one.tip, one.joint_names, one.has_inertia) == (
        other.name,
        other.tip,
        other.joint_names,
        other.has_inertia,
    )
    for field in _ARRAYS:
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))
        assert not getattr(other, field).flags.writeable
    np.testing.assert_array_equal(one.pose(q), other.pose(q))
    np.testing.assert_array_equal(one.jdot_qd(q, q), other.jdot_qd(q, q))


@pytest.mark.parametrize("name", ARMS)
def test_copies_are_the_same_robot(name: str) -> None:
    robot = arm(name)
    _same(robot, pickle.loads(pickle.dumps(robot)))  # noqa: S301 - our own bytes
    _same(robot, copy.deepcopy(robot))


def test_threads_do_not_disturb_each_other() -> None:
    robot = load_robot("lbr_med14")
    rng = np.random.default_rng(10)
    states = [robot.random_configuration(rng) for _ in range(400)]
    serial = [robot.jacobian(q) for q in states]
    with ThreadPoolExecutor(8) as pool:
        parallel = list(pool.map(robot.jacobian, states))
    np.testing.assert_array_equal(parallel, serial)


def test_qdd_max_can_be_overridden() -> None:
    np.testing.assert_array_equal(load_robot("lbr_med14", qdd_max=4).qdd_max, np.full(7, 4.0))
    np.testing.assert_array_equal(load_robot("davinci5", qdd_max=[1, 2, 3, 4, 5]).qdd_max, [1, 2, 3, 4, 5])


@pytest.mark.parametrize(
    ("qdd_max", "message"),
    [
        ([1.0] * 6, r"^qdd_max: expected shape \(7,\), got \(6,\)$"),
        (
            0.0,
            r"^qdd_max: expected positive accelerations, got 0.0 at index 0; leave qdd_max out for .*$",
        ),
        ([1, 1, -1, 1, 1, 1, 1], r"^qdd_max: expected positive accelerations, got -1.0 at index 2; "),
        (np.inf, r"^qdd_max: expected finite numbers, got inf at index 0$"),
        ("fast", r"^qdd_max: expected real numbers, got entries of type <U4$"),
    ],
)
def test_useless_qdd_max_is_named(qdd_max: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load_robot("lbr_med14", qdd_max=qdd_max)


_BAD_VECTORS = [
    (np.zeros(6), r"expected shape \(7,\), got \(6,\)$"),
    (np.zeros((7, 1)), r"expected shape \(7,\), got \(7, 1\)$"),
    (0.0, r"expected shape \(7,\), got \(\)$"),
    ([0, 0, 0, np.nan, 0, 0, 0], r"expected finite numbers, got nan at index 3$"),
    ([0, 0, 0, 0, 0, 0, -np.inf], r"expected finite numbers, got -inf at index 6$"),
    (["a"] * 7, r"expected real numbers, got entries of type <U1$"),
    ([True] * 7, r"expected real numbers, got entries of type bool$"),
    (np.zeros(7, dtype=complex), r"expected real numbers, got entries of type complex128$"),
    (None, r"expected real numbers, got entries of type object$"),
    ([[0.0], [0.0, 1.0]], r"expected real numbers, got \[\[0.0\], \[0.0, 1.0\]\] "),
]


@pytest.mark.parametrize(("value", "message"), _BAD_VECTORS)
def test_every_method_names_a_wrong_input(value: Any, message: str) -> None:
    robot = load_robot("lbr_med14")
    for method in (robot.pose, robot.jacobian, robot.mass_matrix, robot.to_pinocchio):
        with pytest.raises(ValueError, match="^q: " + message):
            method(value)
    for with_velocity in (robot.jdot_qd, robot.bias_forces):
        with pytest.raises(ValueError, match="^q: " + message):
            with_velocity(value, np.zeros(7))
        with pytest.raises(ValueError, match="^qd: " + message):
            with_velocity(np.zeros(7), value)


@given(hnp.arrays(np.float64, st.integers(0, 8)))
def test_finite_vector_returns_a_copy_or_says_why_not(value: np.ndarray) -> None:
    if value.shape == (4,) and np.isfinite(value).all():
        result = finite_vector("x", value, 4)
        np.testing.assert_array_equal(result, value)
        assert not np.shares_memory(result, value)
    else:
        with pytest.raises(ValueError, match=r"^x: expected "):
            finite_vector("x", value, 4)


def test_finite_vector_takes_lists_and_integers() -> None:
    result = finite_vector("x", [1, 2, 3], 3)
    assert result.dtype == np.float64
    np.testing.assert_array_equal(result, [1.0, 2.0, 3.0])


def test_path_and_string_load_the_same() -> None:
    path = example_urdf("ur5")
    one, other = load_robot(path, tip="tool0"), load_robot(str(path), tip="tool0")
    _same(one, other)
    assert isinstance(path, Path)
    assert repr(one) == "Robot('ur5', nv=6, tip='tool0')"


def test_names_are_listed() -> None:
    assert available_robots() == ("davinci5", "lbr_med14", "lbr_med7", "ur5e")


def test_entry_point_adds_a_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("slider", "tests.robots.outside:slider", "kinqp.robots")
    asked: list[str] = []

    def entry_points(*, group: str) -> list[EntryPoint]:
        asked.append(group)
        return [point]

    monkeypatch.setattr(kinqp.robots.registry, "entry_points", entry_points)
    assert "slider" in available_robots()
    robot = load_robot("slider", qdd_max=3.0)
    assert (robot.name, robot.tip, robot.qdd_max.tolist()) == ("slider", "end", [3.0])
    assert set(asked) == {"kinqp.robots"}


def test_module_and_attribute_name_a_robot() -> None:
    robot = load_robot("tests.robots.outside:slider", tip="nose")
    assert (robot.name, robot.tip, robot.qdd_max.tolist()) == ("slider", "nose", [1.0])
    np.testing.assert_array_equal(robot.pose([0.25])[:3, 3], [0.0, 0.0, 0.25])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("tests.robots.outside:NOT_CALLABLE", r"to name a callable \(\*, tip, qdd_max\) -> Robot, got int$"),
        ("tests.robots.outside:not_a_robot", r"to name a callable .* -> Robot, got one that returned str$"),
        (
            "tests.robots.outside:missing",
            r"^robot: expected module:attribute that can be imported, got '.*missing' \(",
        ),
        ("no_such_module:missing", r"^robot: expected module:attribute that can be imported, got "),
        (":", r"^robot: expected module:attribute that can be imported, got ':' \("),
    ],
)
def test_wrong_outside_robot_is_named(name: str, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        load_robot(name)
