"""A tool on the flange moves the tool centre point and nothing else."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from kinqp.robots import RobotError, load_robot, with_tool
from tests.robots.arms import arm

Q = np.deg2rad([20.0, -80.0, 100.0, -100.0, -80.0, 20.0])


def test_tip_is_ahead_of_the_flange() -> None:
    """By hand: 0.16 m along the flange's z, and a lever of that length in the Jacobian."""
    bare = load_robot("ur5e")
    drill = with_tool(bare, "ur5e_drill", (0.0, 0.0, 0.16))
    flange, tip = bare.pose(Q), drill.pose(Q)
    np.testing.assert_allclose(tip[:3, 3], flange[:3, 3] + 0.16 * flange[:3, 2], atol=1e-15)
    np.testing.assert_allclose(tip[:3, :3], flange[:3, :3], atol=1e-15)
    J = bare.jacobian(Q)
    moved = J[:3] + np.cross(J[3:].T, 0.16 * flange[:3, 2]).T
    np.testing.assert_allclose(drill.jacobian(Q), np.vstack([moved, J[3:]]), atol=1e-14)
    assert (drill.name, drill.tip) == ("ur5e_drill", "tool_tip")
    assert (bare.name, bare.tip) == ("ur5e", "tool0")
    assert np.array_equal(drill.q_max, bare.q_max)


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "panda"])
def test_symbols_agree_with_numbers(name: str) -> None:
    tool = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.5, 1.2), np.array([0.02, -0.03, 0.15])).homogeneous
    robot = with_tool(arm(name), "tooled", tool)
    symbol = ca.SX.sym("q", robot.nv)
    made = robot.symbolic(symbol)
    function = ca.Function("f", [symbol], [made.pose, made.jacobian])
    rng = np.random.default_rng(0)
    for _ in range(5):
        q = robot.random_configuration(rng)
        pose, jacobian = (np.asarray(value) for value in function(q))
        np.testing.assert_allclose(pose, arm(name).pose(q) @ tool, atol=1e-12)
        np.testing.assert_allclose(pose, robot.pose(q), atol=1e-12)
        np.testing.assert_allclose(jacobian, robot.jacobian(q), atol=1e-12)


def test_a_tool_on_a_tool() -> None:
    one = with_tool(load_robot("ur5e"), "one", (0.0, 0.0, 0.1))
    two = with_tool(one, "two", (0.0, 0.0, 0.06), tip="end")
    assert np.allclose(two.pose(Q), with_tool(load_robot("ur5e"), "both", (0.0, 0.0, 0.16)).pose(Q), atol=1e-15)


@pytest.mark.parametrize(
    ("name", "pose", "tip", "message"),
    [
        ("ur5e", (0.0, 0.0, 0.1), "end", "name of ur5e with a tool: expected another name, got 'ur5e'"),
        ("", (0.0, 0.0, 0.1), "end", "expected another name, got ''"),
        ("drill", (0.0, 0.0, 0.1), "tool0", "tip of drill: expected a name that no frame of the arm has, got 'tool0'"),
        ("drill", (0.0, 0.0, 0.1), "", "expected a name that no frame"),
        ("drill", (0.0, 0.1), "end", r"expected shape \(3,\) or a homogeneous \(4, 4\), finite, got"),
        ("drill", (0.0, 0.0, np.nan), "end", "finite, got"),
        ("drill", "long", "end", "expected real numbers, got entries of type <U4"),
        ("drill", np.diag([1.0, 1.0, -1.0, 1.0]), "end", "finite with a rotation, got"),
        ("drill", np.diag([2.0, 1.0, 1.0, 1.0]), "end", "finite with a rotation, got"),
        ("drill", np.eye(4) + np.eye(4, k=-3), "end", "finite with a rotation, got"),
    ],
)
def test_wrong_tools_are_named(name: str, pose: object, tip: str, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        with_tool(load_robot("ur5e"), name, pose, tip=tip)  # type: ignore[arg-type]  # that is the point
