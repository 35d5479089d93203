"""The symbolic walk against pinocchio, and its size."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinqp.robots import Robot, RobotError, load_robot
from tests.robots.arms import ARMS, arm

_BY_POSITION = ("pose", "jacobian", "mass_matrix")


def _quantities(robot: Robot) -> tuple[str, ...]:
    dynamics = ("mass_matrix", "bias_forces") if robot.has_inertia else ()
    return ("pose", "jacobian", "jdot_qd", *dynamics)


def _symbols(robot: Robot) -> tuple[Any, Any]:
    return ca.SX.sym("q", robot.nv), ca.SX.sym("qd", robot.nv)


def _function(robot: Robot, names: tuple[str, ...]) -> Any:
    q, qd = _symbols(robot)
    expressions = robot.symbolic(q, qd)
    return ca.Function("f", [q, qd], [getattr(expressions, name) for name in names])


def _numeric(robot: Robot, name: str, q: Any, qd: Any) -> np.ndarray:
    method = getattr(robot, name)
    return np.asarray(method(q) if name in _BY_POSITION else method(q, qd))


def _compare_many(name: str, count: int, seed: int) -> None:
    robot = arm(name)
    names = _quantities(robot)
    rng = np.random.default_rng(seed)
    positions = np.array([robot.random_configuration(rng) for _ in range(count)])
    velocities = rng.uniform(-robot.qd_max, robot.qd_max, (count, robot.nv))
    results = _function(robot, names).map(count)(positions.T, velocities.T)
    for quantity, result in zip(names, results, strict=True):
        expected = np.array([_numeric(robot, quantity, q, qd) for q, qd in zip(positions, velocities, strict=True)])
        # CasADi sets the states' results side by side; vectors come as one column each.
        rows = expected.shape[1]
        got = np.asarray(result).reshape(rows, count, -1).swapaxes(0, 1).reshape(expected.shape)
        # Mixed: |got - expected| <= 1e-12 (1 + |expected|), entry by entry.
        np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12, err_msg=quantity)


@pytest.mark.parametrize("name", ARMS)
def test_symbolic_equals_pinocchio(name: str) -> None:
    _compare_many(name, 1_000, seed=1)


@pytest.mark.long
@pytest.mark.parametrize("name", ARMS)
def test_symbolic_equals_pinocchio_on_more_states(name: str) -> None:
    _compare_many(name, 30_000, seed=2)


@pytest.mark.parametrize("name", ["lbr_med14", "mixed_to_side", "kinova"])
def test_symbolic_equals_pinocchio_far_from_the_limits(name: str) -> None:
    robot = arm(name)
    function = _function(robot, _quantities(robot))
    # Fewer digits far out: sines of large angles and squares of large velocities.
    entries = st.lists(st.floats(-100.0, 100.0), min_size=robot.nv, max_size=robot.nv)

    @settings(max_examples=100, deadline=None)
    @given(entries, entries)
    def check(q: list[float], qd: list[float]) -> None:
        for quantity, result in zip(_quantities(robot), function(q, qd), strict=True):
            expected = _numeric(robot, quantity, q, qd)
            scale = 1.0 + np.max(np.abs(expected)) + np.max(np.abs(q)) ** 2 + np.max(np.abs(qd)) ** 2
            assert np.max(np.abs(np.asarray(result).reshape(expected.shape) - expected)) <= 1e-12 * scale, quantity

    check()


@pytest.mark.parametrize("name", ARMS)
def test_expressions_have_the_documented_shapes_and_are_dense(name: str) -> None:
    robot = arm(name)
    expressions = robot.symbolic(*_symbols(robot))
    shapes = {
        "pose": (4, 4),
        "jacobian": (6, robot.nv),
        "jdot_qd": (6, 1),
        "mass_matrix": (robot.nv, robot.nv),
        "bias_forces": (robot.nv, 1),
    }
    for quantity in _quantities(robot):
        expression = getattr(expressions, quantity)
        assert expression.shape == shapes[quantity]
        assert expression.is_dense()
        assert getattr(expressions, quantity) is expression


@pytest.mark.parametrize(
    ("names", "most"),
    [(("pose", "jacobian"), 260), (("jdot_qd",), 300), (("mass_matrix",), 420), (("bias_forces",), 660)],
)
def test_code_for_the_lbr_stays_small(names: tuple[str, ...], most: int) -> None:
    # Reading the inputs and writing the outputs count too, as they do in the generated C.
    assert _function(load_robot("lbr_med14"), names).n_instructions() <= most


def test_tool_on_the_last_axis_is_not_moved_by_it() -> None:
    robot = load_robot("lbr_med14")
    q, qd = _symbols(robot)
    assert robot.symbolic(q, qd).jacobian[:3, 6].is_zero()


def test_velocity_is_asked_for_only_where_it_is_needed() -> None:
    robot = load_robot("lbr_med14")
    q, _ = _symbols(robot)
    expressions = robot.symbolic(q)
    assert expressions.mass_matrix.shape == (7, 7)
    with pytest.raises(RobotError, match=r"^qd: expected joint velocities for jdot_qd, got none; call .*\(q, qd\)$"):
        _ = expressions.jdot_qd
    with pytest.raises(RobotError, match=r"^qd: expected joint velocities for bias_forces, got none"):
        _ = expressions.bias_forces


def test_symbolic_dynamics_without_masses_is_refused() -> None:
    robot = load_robot("davinci5")
    expressions = robot.symbolic(*_symbols(robot))
    with pytest.raises(RobotError, match=r"^mass_matrix: expected a robot with link inertias, got one without; "):
        _ = expressions.mass_matrix
    with pytest.raises(RobotError, match=r"^bias_forces: expected a robot with link inertias, got one without; "):
        _ = expressions.bias_forces


@pytest.mark.parametrize(
    ("q", "message"),
    [
        (ca.SX.sym("q", 6), r"^q: expected shape \(7, 1\), got \(6, 1\)$"),
        (ca.SX.sym("q", 1, 7), r"^q: expected shape \(7, 1\), got \(1, 7\)$"),
        (ca.MX.sym("q", 7), r"^q: expected a casadi.SX of shape \(7, 1\), got MX$"),
        (np.zeros(7), r"^q: expected a casadi.SX of shape \(7, 1\), got ndarray$"),
        (None, r"^q: expected a casadi.SX of shape \(7, 1\), got NoneType$"),
    ],
)
def test_wrong_symbols_are_named(q: Any, message: str) -> None:
    robot = load_robot("lbr_med14")
    with pytest.raises(RobotError, match=message):
        robot.symbolic(q)
    if q is not None:
        with pytest.raises(RobotError, match=message.replace("^q", "^qd")):
            robot.symbolic(ca.SX.sym("q", 7), q)
