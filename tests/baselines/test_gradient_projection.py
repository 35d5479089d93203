"""The four criteria: gradients against finite differences of the criteria, and what self-motion does to them."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from kinqp.baselines import GradientProjection
from kinqp.baselines.criteria import CRITERIA
from kinqp.control import make_step, simulate
from kinqp.formulations import Mode
from kinqp.robots import Robot
from tests.baselines.planar import situation
from tests.formulations.reference import null_projector, rows_at
from tests.robots.arms import arm

Array = np.ndarray
OBSTACLE = np.array([0.35, -0.25, 0.5])
STEP = 1e-6


def manipulability(robot: Robot, mode: Mode, q: Array) -> float:
    J = np.vstack(rows_at(robot, mode, q))
    return float(np.sqrt(np.linalg.det(J @ J.T)))


def distance(robot: Robot, q: Array, obstacle: Array) -> float:
    """From points spread densely over the skeleton, whose joints pinocchio places."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.to_pinocchio(q))
    corners = [data.oMi[joint].translation.copy() for joint in range(1, robot.model.njoints)]
    corners.append(robot.pose(q)[:3, 3])
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    points = np.vstack([a + share * (b - a) for a, b in pairwise(corners)])
    return float(np.min(np.linalg.norm(points - obstacle, axis=1)))


def slope(function: object, q: Array) -> Array:
    steps = STEP * np.eye(len(q))
    return np.array([(function(q + e) - function(q - e)) / (2.0 * STEP) for e in steps])  # type: ignore[operator]  # a function of q


@pytest.mark.parametrize("text", ["position", "fix-orientation", "plane:1,-2,0.5", "rcm:-0.12"])
@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "kinova"])
def test_manipulability_gradient(name: str, text: str) -> None:
    robot, mode = arm(name), Mode.parse(text)
    step = make_step(robot, "gradient-projection(criterion=manipulability)", mode)
    rng = np.random.default_rng(0)
    for _ in range(3):
        q = robot.random_configuration(rng)
        at = step.observe(q, np.zeros(mode.m_free))
        expected = slope(lambda x: manipulability(robot, mode, x), q)
        np.testing.assert_allclose(CRITERIA["manipulability"](at, q), expected, atol=1e-7)


def test_manipulability_gradient_is_finite_where_it_is_singular_and_zero_without_redundancy_to_measure() -> None:
    robot = arm("lbr_med14")
    at = make_step(robot, "gradient-projection(criterion=manipulability)", "fix-orientation").observe(
        np.zeros(7), np.zeros(3)
    )
    assert np.isfinite(CRITERIA["manipulability"](at, np.zeros(7))).all()
    short = arm("davinci5")
    at = make_step(short, "gradient-projection(criterion=manipulability)", "free").observe(np.zeros(5), np.zeros(6))
    np.testing.assert_array_equal(CRITERIA["manipulability"](at, np.zeros(5)), np.zeros(5))


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "davinci5"])
def test_obstacle_gradient(name: str) -> None:
    robot = arm(name)
    step = make_step(robot, "gradient-projection(criterion=obstacle-distance)", "position")
    rng = np.random.default_rng(1)
    for _ in range(3):
        q = robot.random_configuration(rng)
        at = step.observe(q, np.zeros(3), obstacle=OBSTACLE)
        expected = slope(lambda x: distance(robot, x, OBSTACLE), q)
        np.testing.assert_allclose(CRITERIA["obstacle-distance"](at, q), expected, atol=2e-4)
    at = step.observe(q, np.zeros(3))
    np.testing.assert_array_equal(CRITERIA["obstacle-distance"](at, q), np.zeros(robot.nv))


def test_joint_limits_by_hand() -> None:
    """Row (1, 1, 1), hand 0.3: 0.1 each; downhill from q is -k W (q - middle), less its mean."""
    q, weight = np.array([0.5, -0.1, 0.2]), np.array([1.0, 2.0, 4.0])
    at = situation(np.ones((1, 3)), [0.3], q=q, q_max=[1.0, 1.0, np.inf], gain=2.0, criterion_weight=weight)
    downhill = np.array([-0.5, 0.2, 0.0])  # the third has no upper limit, and no middle
    found = GradientProjection("viable", "joint-limits").resolve(at)
    np.testing.assert_allclose(found.qd, 0.1 + 2.0 * (downhill - downhill.mean()), atol=1e-15)


def test_joint_velocity_by_hand() -> None:
    """Row (1, 1), hand 2: least norm (1, 1). Weights (1, 3): z = -(1/3, 1), projected (1/3, -1/3)."""
    for gain, expected in ((1.0, [4.0 / 3.0, 2.0 / 3.0]), (1.5, [1.5, 0.5])):
        at = situation(np.ones((1, 2)), [2.0], gain=gain, criterion_weight=[1.0, 3.0])
        found = GradientProjection("viable", "joint-velocity").resolve(at)
        np.testing.assert_allclose(found.qd, expected, atol=1e-15)  # 1.5 is the weighted least norm
    at = situation(np.ones((1, 2)), [2.0], gain=1.0, criterion_weight=[3.0, 3.0])
    np.testing.assert_allclose(GradientProjection("viable", "joint-velocity").resolve(at).qd, [1.0, 1.0], atol=1e-15)


class Still:
    """A hand that holds the tool where it is."""

    def twist(self, t: float, pose: Array) -> Array:  # noqa: ARG002  # as a Guide is called
        return np.zeros(6)


@pytest.mark.parametrize(
    ("criterion", "gain"), [("joint-limits", 1.0), ("manipulability", 10.0), ("obstacle-distance", 1.0)]
)
def test_self_motion_improves_the_criterion_and_moves_no_task(criterion: str, gain: float) -> None:
    robot, mode = arm("lbr_med14"), Mode.fix_orientation()
    q = np.deg2rad([30.0, 40.0, -25.0, -80.0, 20.0, 50.0, 10.0])
    given = {"gain": gain} | ({"obstacle": OBSTACLE} if criterion == "obstacle-distance" else {})
    step = make_step(robot, f"gradient-projection(criterion={criterion})", mode)
    first = step(q, np.zeros(3), **given)
    P = null_projector(robot.jacobian(q))
    np.testing.assert_allclose(P @ first.qd, first.qd, atol=1e-12)
    assert np.linalg.norm(first.qd) > 1e-3

    def better(x: Array) -> float:
        if criterion == "joint-limits":
            return -0.5 * float(x @ x)  # the ranges' middles are zero
        return manipulability(robot, mode, x) if criterion == "manipulability" else distance(robot, x, OBSTACLE)

    assert better(q + 1e-4 * first.qd / np.linalg.norm(first.qd)) > better(q)


def test_without_a_gain_it_is_the_task_alone() -> None:
    robot, q = arm("lbr_med14"), np.deg2rad([30.0, 40.0, -25.0, -80.0, 20.0, 50.0, 10.0])
    plain = make_step(robot, "task-priority(limits=none)", "position")(q, [0.1, 0.0, 0.1])
    for criterion in CRITERIA:
        step = make_step(robot, f"gradient-projection(criterion={criterion})", "position")
        np.testing.assert_array_equal(step(q, [0.1, 0.0, 0.1], gain=0.0).qd, plain.qd)


def test_middle_of_the_ranges_is_where_it_comes_to_rest() -> None:
    robot = arm("lbr_med14")
    run = simulate(
        make_step(robot, "gradient-projection", "position"),
        Still(),
        np.deg2rad([30.0, 40.0, -25.0, -80.0, 20.0, 50.0, 10.0]),
        6.0,
        dt=0.02,
    )
    assert np.linalg.norm(run.q_end) < np.linalg.norm(run.q[0])
    assert np.abs(run.qd[-1]).max() < 0.01 * np.abs(run.qd[0]).max()
    np.testing.assert_allclose(run.position[-1], run.position[0], atol=0.02)
