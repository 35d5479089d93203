"""Rows of the arm angle and of the remote centre: values by hand, slopes by finite differences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from kinqp.formulations import Mode
from kinqp.formulations.constraints import ElbowBend, ElbowHold, ElbowRange, RemoteCentre
from kinqp.robots import RobotError
from tests.finite_differences import difference_jacobian
from tests.formulations.constraints.rows import RowsOf
from tests.robots.arms import arm

if TYPE_CHECKING:
    from kinqp.robots import Robot

Array = NDArray[np.float64]
BENT = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 20.0])
DT = 1e-3


def angle_by_hand(robot: Robot, q: Array) -> float:
    """Arm angle from pinocchio's joint placements: the LBR's centres lie on the axes of A2, A4 and A6."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    shoulder, elbow, wrist = (np.array(data.oMi[i].translation) for i in (2, 4, 6))
    if robot.name == "lbr_med7":
        wrist = data.oMi[6].act(np.array([0.0, 0.0, 0.0607]))
    line = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    side, up = elbow - shoulder, np.array([0.0, 0.0, 1.0])
    side, up = side - line * (line @ side), up - line * (line @ up)
    return float(np.arctan2(line @ np.cross(up, side), up @ side))


@pytest.mark.parametrize("name", ["lbr_med14", "lbr_med7"])
def test_arm_angle_and_its_rate(name: str) -> None:
    robot = arm(name)
    rows = RowsOf(ElbowRange(approach="step", retreat=False), robot)
    rng = np.random.default_rng(4)
    for _ in range(30):
        q = robot.random_configuration(rng)
        angle = angle_by_hand(robot, q)
        # A range about the true angle, so that the difference of angles is zero there.
        at = rows(q, elbow_range_angle=angle, elbow_range_width=0.1)
        scale = -at["l"][0] / (0.1 / DT)
        np.testing.assert_allclose(at["l"], -scale * 0.1 / DT, rtol=1e-9)
        rate = difference_jacobian(lambda x, at=angle: np.unwrap([at, angle_by_hand(robot, x)])[1:], q, 1e-4)
        assert scale > 0.0
        if scale > 0.02:
            np.testing.assert_allclose(at["C"][0] / scale, -rate[0], rtol=0, atol=1e-5)
        np.testing.assert_allclose(at["C"][1], -at["C"][0], rtol=0, atol=1e-15)


def test_self_motion_turns_the_elbow_by_hand() -> None:
    """Elbow up in the plane y = 0: angle 0. Turning the arm about the line shoulder-wrist by 30 deg makes it 30 deg."""
    robot = arm("lbr_med14")
    q = np.deg2rad([0.0, 40.0, 0.0, -80.0, 0.0, 50.0, 0.0])
    assert angle_by_hand(robot, q) == pytest.approx(0.0, abs=1e-12)
    rows = RowsOf(ElbowHold(), robot)
    row = rows(q)["A"][0]
    # In this plane A2, A4 and A6 leave the angle alone; A1 turns all three centres about the vertical: unchanged too.
    np.testing.assert_allclose(row[[0, 1, 3, 5, 6]], 0.0, atol=1e-12)
    assert abs(row[2]) > 0.01
    # A5 moves nothing above the wrist.
    assert row[4] == pytest.approx(0.0, abs=1e-12)


def test_arm_angle_where_it_is_undefined() -> None:
    robot = arm("lbr_med14")
    hold, kept = RowsOf(ElbowHold(correct=True), robot), RowsOf(ElbowRange(), robot)
    stretched = np.array([0.3, 0.5, 0.2, 0.0, 0.1, 0.4, 0.0])
    for q in (np.zeros(7), stretched, np.deg2rad([0, 30, 0, -60, 0, 30, 0])):
        held, within = hold(q, elbow_hold_angle=1.0), kept(q, v=np.ones(6))
        for values in (*held.values(), *within.values()):
            assert not np.isnan(values).any()
    at = hold(stretched, elbow_hold_angle=1.0)
    np.testing.assert_allclose(at["A"], 0.0, atol=1e-6)


def test_arm_angle_needs_shoulder_elbow_and_wrist() -> None:
    with pytest.raises(RobotError, match=r"arm angle of ur5e: expected seven revolute joints .* got 6 joints"):
        RowsOf(ElbowHold(), arm("ur5e"))
    with pytest.raises(RobotError, match=r"expected seven revolute joints .* got axes 3 to 5 that pass the elbow by"):
        RowsOf(ElbowRange(), arm("panda"))


def test_elbow_correction_by_hand() -> None:
    """0.01 rad off at 5/s: 0.05 rad/s; 1 rad off: 0.2 rad/s. Both times the row's factor."""
    robot = arm("lbr_med14")
    rows = RowsOf(ElbowHold(correct=True), robot)
    angle = angle_by_hand(robot, BENT)
    scale = -RowsOf(ElbowRange(approach="step", retreat=False), robot)(
        BENT, elbow_range_angle=angle, elbow_range_width=DT
    )["l"][0]
    for off, speed in ((0.01, 0.05), (-0.01, -0.05), (1.0, 0.2), (2 * np.pi + 0.01, 0.05)):
        at = rows(BENT, elbow_hold_angle=angle + off)
        assert at["b"][0] == 0.0
        assert at["A"][0, 7] == pytest.approx(-scale * speed)


def test_remote_centre_is_mode_rcm_at_the_pivot() -> None:
    robot = arm("lbr_med14")
    depth = -0.12
    pose = robot.pose(BENT)
    mode = Mode.rcm(depth)
    locked = (mode.twist_map_at(pose) @ robot.jacobian(BENT))[list(mode.fixed_rows)]
    rows = RowsOf(RemoteCentre(), robot)
    on_shaft = pose[:3, 3] + depth * pose[:3, 2]
    at = rows(BENT, remote_centre_pivot=on_shaft)
    np.testing.assert_allclose(at["A"][:, :7], locked, atol=1e-12)
    np.testing.assert_allclose(at["A"][:, 7], 0.0, atol=1e-12)
    # Beside the shaft by 1 mm along the tool's x: corrected at 10/s; by 10 mm: at 20 mm/s.
    for off, speed in ((1e-3, 0.01), (1e-2, 0.02)):
        at = rows(BENT, remote_centre_pivot=on_shaft + off * pose[:3, 0])
        np.testing.assert_array_equal(at["b"], 0.0)
        np.testing.assert_allclose(at["A"][:, 7], [-speed, 0.0], atol=1e-12)


def test_remote_centre_rows_move_the_shaft() -> None:
    """Along a motion that the rows allow the shaft's distance from the pivot stays, to second order."""
    robot = arm("lbr_med14")
    pose = robot.pose(BENT)
    pivot = pose[:3, 3] - 0.2 * pose[:3, 2]
    A = RowsOf(RemoteCentre(pivot=tuple(pivot)), robot)(BENT)["A"][:, :7]

    def offset(q: Array) -> Array:
        now = robot.pose(q)
        return np.asarray(now[:3, :2].T @ (pivot - now[:3, 3]))

    np.testing.assert_allclose(-A, difference_jacobian(offset, BENT), rtol=0, atol=1e-9)


def test_the_elbows_offset_and_its_rate() -> None:
    """Of the triangle with sides 0.42 and 0.40 m and the angle A4 between their extensions."""
    robot = arm("lbr_med14")
    rows = RowsOf(ElbowBend(approach="step", retreat=False), robot)

    def offset(q: Array) -> Array:
        return -rows(q, elbow_bend_min=0.0, dt=DT)["l"] * DT

    rng = np.random.default_rng(5)
    for _ in range(10):
        q = robot.random_configuration(rng)
        wanted = 0.42 * 0.40 * abs(np.sin(q[3])) / np.sqrt(0.42**2 + 0.40**2 + 2 * 0.42 * 0.40 * np.cos(q[3]))
        assert offset(q)[0] == pytest.approx(wanted, abs=1e-12)
        if wanted > 0.02:
            np.testing.assert_allclose(rows(q)["C"], difference_jacobian(offset, q), rtol=0, atol=1e-8)
