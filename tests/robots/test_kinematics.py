"""Numeric kinematics against finite differences and against closed forms that share no code with it."""

from __future__ import annotations

from functools import reduce

import numpy as np
import pytest

from kinqp.robots import Robot, RobotError, load_robot
from tests.finite_differences import difference_jacobian
from tests.robots.arms import ARMS, arm


def _states(robot: Robot, count: int, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    return [(robot.random_configuration(rng), rng.uniform(-1.0, 1.0, robot.nv)) for _ in range(count)]


def _unskew(matrix: np.ndarray) -> np.ndarray:
    return np.array([matrix[2, 1], matrix[0, 2], matrix[1, 0]])


@pytest.mark.parametrize("name", ARMS)
def test_jacobian_is_the_derivative_of_the_pose(name: str) -> None:
    robot = arm(name)
    for q, _ in _states(robot, 30, seed=3):
        rate = difference_jacobian(robot.pose, q)
        rotation = robot.pose(q)[:3, :3]
        linear = rate[:3, 3, :]
        angular = np.column_stack([_unskew(rate[:3, :3, i] @ rotation.T) for i in range(robot.nv)])
        np.testing.assert_allclose(robot.jacobian(q), np.vstack([linear, angular]), rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("name", ARMS)
def test_jdot_qd_is_the_rate_of_the_jacobian_times_qd(name: str) -> None:
    robot = arm(name)
    for q, qd in _states(robot, 30, seed=4):

        def twist(time: np.ndarray, q: np.ndarray = q, qd: np.ndarray = qd) -> np.ndarray:
            return np.asarray(robot.jacobian(q + time[0] * qd) @ qd)

        along = difference_jacobian(twist, np.zeros(1))[:, 0]
        np.testing.assert_allclose(robot.jdot_qd(q, qd), along, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", [name for name in ARMS if name != "davinci5"])
def test_inertia_and_bias_satisfy_the_energy_balance(name: str) -> None:
    """Symmetric and positive definite; Lagrange: bias = Mdot qd - d(qd' M qd / 2)/dq + gravity."""
    robot = arm(name)
    for q, qd in _states(robot, 10, seed=5):
        mass = robot.mass_matrix(q)
        np.testing.assert_array_equal(mass, mass.T)
        assert np.linalg.eigvalsh(mass)[0] > 0.0
        rate = difference_jacobian(robot.mass_matrix, q)
        coriolis = np.einsum("ijk,k,j->i", rate, qd, qd) - 0.5 * np.einsum("jki,j,k->i", rate, qd, qd)
        gravity = robot.bias_forces(q, np.zeros(robot.nv))
        np.testing.assert_allclose(robot.bias_forces(q, qd) - gravity, coriolis, rtol=1e-8, atol=1e-8)


def _dh(theta: float, d: float, a: float, alpha: float) -> np.ndarray:
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


_LBR_TWISTS = np.radians([-90.0, 90.0, 90.0, -90.0, -90.0, 90.0, 0.0])
_UR_TWISTS = np.radians([90.0, 0.0, 0.0, 90.0, -90.0, 0.0])


@pytest.mark.parametrize(
    ("name", "d", "a", "alpha"),
    [
        ("lbr_med14", [0.36, 0.0, 0.42, 0.0, 0.40, 0.0, 0.126], np.zeros(7), _LBR_TWISTS),
        ("lbr_med7", [0.34, 0.0, 0.40, 0.0, 0.40, 0.0, 0.126], np.zeros(7), _LBR_TWISTS),
        (
            "ur5e",
            [0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996],
            [0.0, -0.425, -0.3922, 0.0, 0.0, 0.0],
            _UR_TWISTS,
        ),
    ],
)
def test_pose_is_the_product_of_published_dh_transforms(
    name: str, d: list[float], a: list[float], alpha: np.ndarray
) -> None:
    robot = load_robot(name)
    for q, _ in _states(robot, 200, seed=6):
        expected = reduce(np.matmul, map(_dh, q, d, a, alpha))
        np.testing.assert_allclose(robot.pose(q), expected, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(("name", "height"), [("lbr_med14", 1.306), ("lbr_med7", 1.266)])
def test_lbr_stands_upright_at_zero(name: str, height: float) -> None:
    expected = np.eye(4)
    expected[2, 3] = height
    np.testing.assert_allclose(load_robot(name).pose(np.zeros(7)), expected, rtol=0.0, atol=1e-14)


def test_davinci_pose_is_the_printed_matrix() -> None:
    """
    Table 2 of the report, entry by entry, with its lengths in metres.

    Its entry (2, 2) has lost a minus sign: as printed, the matrix is not a rotation. It is checked both ways.
    """
    robot = load_robot("davinci5")
    for q, _ in _states(robot, 1_000, seed=7):
        th8, d9, th10, th11, th12 = q
        c8, s8, c10, s10 = np.cos(th8), np.sin(th8), np.cos(th10), np.sin(th10)
        c11, s11, c12, s12 = np.cos(th11), np.sin(th11), np.cos(th12), np.sin(th12)
        printed = np.array(
            [
                [
                    -c12 * (s8 * s11 - c8 * c10 * c11) - c8 * s10 * s12,
                    s12 * (s8 * s11 - c8 * c10 * c11) - c8 * c12 * s10,
                    -c11 * s8 - c8 * c10 * s11,
                    0.3 * c8 - 0.018 * c11 * s8 - d9 * s8 - 0.018 * c8 * c10 * s11,
                ],
                [
                    c12 * (c8 * s11 + c10 * c11 * s8) - s8 * s10 * s12,
                    s12 * (c8 * s11 + c10 * c11 * s8) - c12 * s8 * s10,
                    c8 * c11 - c10 * s8 * s11,
                    0.3 * s8 + 0.018 * c8 * c11 + d9 * c8 - 0.018 * c10 * s8 * s11,
                ],
                [
                    -c10 * s12 - c11 * c12 * s10,
                    c11 * s10 * s12 - c10 * c12,
                    s10 * s11,
                    0.018 * s10 * s11,
                ],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        lost_sign = 2.0 * s12 * (c8 * s11 + c10 * c11 * s8)
        # Columns of a rotation are orthogonal; the printed second column misses that by the lost term.
        assert printed[:3, 0] @ printed[:3, 1] == pytest.approx(lost_sign * printed[1, 0], rel=0.0, abs=1e-14)
        printed[1, 1] -= lost_sign
        np.testing.assert_allclose(robot.pose(q), printed, rtol=0.0, atol=1e-14)


def test_numeric_dynamics_without_masses_is_refused() -> None:
    robot = load_robot("davinci5")
    assert not robot.has_inertia
    with pytest.raises(RobotError, match=r"^mass_matrix: expected a robot with link inertias, got one without; "):
        robot.mass_matrix(robot.q_min)
    with pytest.raises(RobotError, match=r"^bias_forces: expected a robot with link inertias, got one without; "):
        robot.bias_forces(robot.q_min, np.zeros(5))
