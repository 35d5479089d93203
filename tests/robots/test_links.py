"""Points of intermediate links: symbolic against pinocchio."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from kinqp.robots import RobotError, load_robot
from tests.finite_differences import difference_jacobian
from tests.robots.arms import ARMS, arm


@pytest.mark.parametrize("name", ARMS)
def test_points_of_every_link_and_their_jacobians(name: str) -> None:
    robot = arm(name)
    rng = np.random.default_rng(3)
    locals_ = rng.uniform(-0.3, 0.3, (robot.nv + 1, 3))
    q = ca.SX.sym("q", robot.nv)
    kinematics = robot.symbolic(q)
    points = [kinematics.point_on_link(link, local) for link, local in enumerate(locals_)]
    jacobians = [kinematics.point_jacobian(link, point) for link, point in enumerate(points)]
    function = ca.Function("f", [q], [ca.horzcat(*points), *(ca.densify(J) for J in jacobians)])
    data = robot.model.createData()
    for _ in range(20):
        at = robot.random_configuration(rng)
        got, *slopes = (np.asarray(value) for value in function(at))
        pin.forwardKinematics(robot.model, data, robot.to_pinocchio(at))
        wanted = [local if link == 0 else data.oMi[link].act(local) for link, local in enumerate(locals_)]
        np.testing.assert_allclose(got.T, wanted, rtol=0, atol=1e-12)
        differences = difference_jacobian(lambda x: np.asarray(function(x)[0]).T, at)
        np.testing.assert_allclose(slopes, differences, rtol=0, atol=1e-9)
        # Joints beyond the link do not move it, by structure.
        assert all(not np.any(slope[:, link:]) for link, slope in enumerate(slopes))


def test_a_link_that_does_not_exist_is_named() -> None:
    kinematics = load_robot("lbr_med14").symbolic(ca.SX.sym("q", 7))
    with pytest.raises(RobotError, match=r"^link: expected 0 \(the base\) to 7, got 8$"):
        kinematics.point_on_link(8, (0.0, 0.0, 0.0))
    with pytest.raises(RobotError, match=r"^link: expected 0 \(the base\) to 7, got -1$"):
        kinematics.point_jacobian(-1, ca.SX(3, 1))
