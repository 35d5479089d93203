"""The rows of every constraint: values by hand, slopes by finite differences, and zero motion inside."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import coal
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from kinqp.formulations import Mode
from kinqp.formulations.constraints import (
    Constraint,
    ContactForce,
    ElbowHold,
    ElbowRange,
    GapConstraint,
    Obstacle,
    Obstacles,
    RemoteCentre,
    SelfCollision,
    SingularityAvoidance,
    TwistLimits,
)
from kinqp.robots import Capsule, Robot, capsule_model
from tests.control.states import states
from tests.finite_differences import difference_jacobian
from tests.formulations.constraints.rows import RowsOf
from tests.robots.arms import arm

Array = NDArray[np.float64]
BENT = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 20.0])
DT = 1e-3


def shape_of(capsule: Capsule) -> tuple[coal.CollisionGeometry, pin.SE3]:
    start, end = np.array(capsule.start), np.array(capsule.end)
    if capsule.is_sphere:
        return coal.Sphere(capsule.radius), pin.SE3(np.eye(3), start)
    length = float(np.linalg.norm(end - start))
    turned = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (end - start) / length)
    return coal.Capsule(capsule.radius, length), pin.SE3(turned.toRotationMatrix(), (start + end) / 2)


def coal_gap(robot: Robot, q: Array, first: Capsule, second: Capsule) -> float:
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.to_pinocchio(q))
    arguments: list[object] = []
    for capsule in (first, second):
        shape, place = shape_of(capsule)
        world = data.oMi[capsule.link] * place
        arguments += [shape, coal.Transform3s(world.rotation, world.translation)]
    return float(coal.distance(*arguments, coal.DistanceRequest(), coal.DistanceResult()))


@pytest.mark.parametrize("name", ["lbr_med14", "lbr_med7", "ur5e"])
def test_distances_are_coals_and_rows_their_slopes(name: str) -> None:
    robot = arm(name)
    constraint = SelfCollision(approach="step", retreat=False)
    rows = RowsOf(constraint, robot)
    pairs = constraint.checked_pairs(robot)

    def gaps(q: Array) -> Array:
        return -rows(q, self_collision_margin=0.0, dt=DT)["l"] * DT

    rng = np.random.default_rng(0)
    compared = 0
    for _ in range(40):
        q = robot.random_configuration(rng)
        wanted = np.array([coal_gap(robot, q, *pair) for pair in pairs])
        apart = wanted > 1e-3
        np.testing.assert_allclose(gaps(q)[apart], wanted[apart], rtol=0, atol=1e-9)
        # Slopes where the closest points do not change features within the stencil: there both differences agree.
        coarse, fine = difference_jacobian(gaps, q, 2e-4), difference_jacobian(gaps, q, 1e-4)
        smooth = apart & (np.abs(coarse - fine).max(axis=1) < 1e-9)
        np.testing.assert_allclose(rows(q)["C"][smooth], fine[smooth], rtol=0, atol=1e-7)
        compared += int(smooth.sum())
    assert compared > 20 * len(pairs)


def test_obstacles_are_where_the_parameters_say() -> None:
    robot = arm("lbr_med14")
    bar = Obstacle("post", (0.5, 0.1, 0.0), (0.5, 0.1, 0.8), 0.04)
    constraint = Obstacles(obstacles=(Obstacle("ball", (0.4, 0.0, 0.9)), bar), approach="step", retreat=False)
    rows = RowsOf(constraint, robot)
    own = [c for c in capsule_model("lbr_med14").capsules if c.link]
    given = {
        "obstacles_ball_start": np.array([0.3, -0.4, 0.7]),
        "obstacles_ball_radius": 0.1,
        "obstacles_post_end": np.array([0.6, 0.2, 0.5]),
        "obstacles_margin": 0.0,
    }
    world = (
        Capsule("ball", 0, (0.3, -0.4, 0.7), (0.3, -0.4, 0.7), 0.1),
        Capsule("post", 0, bar.start, (0.6, 0.2, 0.5), 0.04),
    )

    def gaps(q: Array) -> Array:
        return -rows(q, dt=DT, **given)["l"] * DT

    rng = np.random.default_rng(1)
    for _ in range(20):
        q = robot.random_configuration(rng)
        wanted = np.array([coal_gap(robot, q, capsule, other) for other in world for capsule in own])
        apart = wanted > 1e-3
        np.testing.assert_allclose(gaps(q)[apart], wanted[apart], rtol=0, atol=1e-9)
        coarse, fine = difference_jacobian(gaps, q, 2e-4), difference_jacobian(gaps, q, 1e-4)
        smooth = apart & (np.abs(coarse - fine).max(axis=1) < 1e-9)
        np.testing.assert_allclose(rows(q, **given)["C"][smooth], fine[smooth], rtol=0, atol=1e-7)


def test_two_spheres_by_hand() -> None:
    """The tool's ball 0.2 m in front of an obstacle, along x: gap 0.2 - 0.05 - 0.04 - 0.01 = 0.1 m."""
    robot = arm("lbr_med14")
    tip = robot.pose(BENT)[:3, 3]
    flange = Capsule("tool", 7, (0.0, 0.0, 0.045), (0.0, 0.0, 0.045), 0.05)
    rows = {
        approach: RowsOf(Obstacles(capsules=(flange,), approach=approach, retreat=False), robot)
        for approach in ("viable", "damper", "step")
    }
    given = {
        "obstacles_sphere1_start": tip + np.array([0.2, 0, 0]),
        "obstacles_sphere1_radius": 0.04,
        "obstacles_margin": 0.01,
    }
    at = {name: one(BENT, **given) for name, one in rows.items()}
    for one in at.values():
        np.testing.assert_allclose(one["C"][0, :7], -robot.jacobian(BENT)[0], atol=1e-12)
        assert one["u"][0] == np.inf
    assert at["step"]["l"][0] == pytest.approx(-100.0)  # 0.1 m in 1 ms
    assert at["damper"]["l"][0] == pytest.approx(-1.0)  # 10/s times 0.1 m
    # 0.1 m = a dt^2 (m (m + 1) / 2 + (m + 1) theta) with a = 2: m = 315, theta = 230 / 316; b = a dt (m + theta).
    assert at["viable"]["l"][0] == pytest.approx(-2e-3 * (315 + 230 / 316))
    # Inside the margin: no further.
    given["obstacles_sphere1_start"] = tip + np.array([0.08, 0, 0])
    assert all(one(BENT, **given)["l"][0] == 0.0 for one in rows.values())


def test_retreat_is_asked_for_while_the_hand_guides() -> None:
    """4 mm too close: 50/s times that is more than 0.05 m/s, times 0.09 / (0.09 + 0.01) for a hand at 0.09 m/s."""
    robot = arm("lbr_med14")
    tip = robot.pose(BENT)[:3, 3]
    flange = Capsule("tool", 7, (0.0, 0.0, 0.045), (0.0, 0.0, 0.045), 0.05)
    rows = RowsOf(Obstacles(capsules=(flange,)), robot)
    given = {"obstacles_sphere1_start": tip + np.array([0.116, 0, 0])}  # 0.116 - 0.05 - 0.05 - 0.02
    still, guided = rows(BENT, **given), rows(BENT, v=[0.09, 0, 0, 0, 0, 0], **given)
    assert still["l"][0] == 0.0
    assert still["C"][0, 7] == 0.0
    assert guided["l"][0] == 0.0  # giving all of it up leaves "no further"
    assert guided["C"][0, 7] == pytest.approx(-0.045)
    np.testing.assert_array_equal([guided["lb"][7], guided["ub"][7]], [0.0, 1.0])
    slight = rows(BENT, v=[0.09, 0, 0, 0, 0, 0], **(given | {"obstacles_margin": 0.0161}))
    assert slight["C"][0, 7] == pytest.approx(-0.9 * 50 * 1e-4)


def test_twist_limits_by_hand() -> None:
    robot = arm("lbr_med14")
    J, R = robot.jacobian(BENT), robot.pose(BENT)[:3, :3]
    limits = {"twist_limits_linear": [0.1, 0.2, 0.3], "twist_limits_angular": [0.4, np.inf, 0.6]}
    turned = np.vstack([R.T @ J[:3], R.T @ J[3:]])
    pivoting = Mode.rcm(0.1)
    wanted = {"world": J, "tool": turned, "mode": pivoting.twist_map_at(robot.pose(BENT)) @ J}
    for frame, matrix in wanted.items():
        at = RowsOf(TwistLimits(frame=frame), robot, str(pivoting))(BENT, **limits)
        np.testing.assert_allclose(at["C"], matrix, atol=1e-12)
        np.testing.assert_array_equal(at["u"], [0.1, 0.2, 0.3, 0.4, np.inf, 0.6])
        np.testing.assert_array_equal(at["l"], -at["u"])


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "davinci5"])
@pytest.mark.parametrize("which", ["all", "position", "guided"])
def test_manipulability_is_the_product_of_singular_values(name: str, which: str) -> None:
    robot = arm(name)
    mode = Mode.fix_orientation()
    rows = RowsOf(SingularityAvoidance(rows=which, approach="step", retreat=False), robot, str(mode))
    rng = np.random.default_rng(2)

    def measure(q: Array) -> Array:
        return 1e-9 - rows(q, singularity_w_min=1e-9, dt=DT)["l"] * DT

    compared = 0
    for _ in range(10):
        q = robot.random_configuration(rng)
        J = robot.jacobian(q)
        if which == "position":
            J = J[:3]
        elif which == "guided":
            J = J[:3] @ (np.eye(robot.nv) - np.linalg.pinv(J[3:], rcond=1e-9) @ J[3:])
        singular = np.linalg.svd(J, compute_uv=False)
        wanted = np.prod(np.sqrt(singular**2 + 1e-8))
        assert measure(q)[0] == pytest.approx(wanted, rel=1e-6, abs=1e-10)
        if singular[-1] > 0.02:
            np.testing.assert_allclose(rows(q)["C"], difference_jacobian(measure, q, 1e-3), rtol=0, atol=1e-6)
            compared += 1
    # The da Vinci arm's tip is 18 mm long: its third singular value stays below what is compared here.
    assert compared > 4 or name == "davinci5"


def test_contact_force_by_hand() -> None:
    """20 N allowed, 15 N now, 10,000 N/m, gain 10/s: 5 mm/s along the normal; step: 0.5 mm in 1 ms."""
    robot = arm("lbr_med14")
    down = -robot.jacobian(BENT)[2]
    given = {"contact_force_normal": [0.0, 0.0, -3.0], "contact_force_now": 15.0}
    for approach, speed in (("damper", 5e-3), ("step", 0.5)):
        at = RowsOf(ContactForce(approach=approach, retreat=False), robot)(BENT, **given)
        np.testing.assert_allclose(at["C"][0], -down, atol=1e-12)
        assert at["l"][0] == pytest.approx(-speed)
    rows = RowsOf(ContactForce(), robot)
    too_much = rows(BENT, v=[1e9, 0, 0, 0, 0, 0], **(given | {"contact_force_now": 21.0}))
    assert too_much["C"][0, 7] == pytest.approx(-50 * 1e-4)  # 1 N is 0.1 mm of giving way
    none = rows(BENT, contact_force_now=1e3)
    assert not none["C"].any()
    assert none["l"][0] == 0.0


CONSTRAINTS: tuple[Constraint, ...] = (
    TwistLimits(),
    SelfCollision(),
    Obstacles(obstacles=(Obstacle("post", (0.3, 0.1, 0.0), (0.3, 0.1, 0.8)), Obstacle("ball", (0.0, 0.0, 0.5)))),
    SingularityAvoidance(),
    SingularityAvoidance(rows="guided"),
    ContactForce(),
    RemoteCentre(pivot="0.5 0 0.3"),
)
ELBOW: tuple[Constraint, ...] = (ElbowRange(), ElbowHold(), ElbowHold(correct=True))


@pytest.mark.parametrize("robot_name", ["lbr_med14", "ur5e"])
@pytest.mark.parametrize("approach", ["viable", "damper", "step"])
def test_zero_motion_is_inside_whatever_the_state(robot_name: str, approach: str) -> None:
    robot = arm(robot_name)
    for constraint in CONSTRAINTS + (ELBOW if robot_name == "lbr_med14" else ()):
        if not isinstance(constraint, GapConstraint) and approach != "viable":
            continue
        chosen = replace(constraint, approach=approach) if isinstance(constraint, GapConstraint) else constraint
        rows = RowsOf(chosen, robot, "fix-orientation")
        given = {"elbow_hold_angle": 2.0, "contact_force_normal": [0.0, 1.0, 0.0], "contact_force_now": 100.0}
        for kind, q in states(robot, 24):
            at = rows(q, v=[0.3, 0.0, -0.1], **given)
            case = f"{constraint.name}, {kind}, q={q!r}"
            x = at["x_feasible"]
            assert not x[: robot.nv].any(), case
            for name in ("A", "b", "C", "x_feasible"):
                assert np.isfinite(at[name]).all(), case
            np.testing.assert_allclose(at["A"] @ x, at["b"], rtol=0, atol=1e-15, err_msg=case)
            assert (at["C"] @ x >= at["l"] - 1e-15).all(), case
            assert (at["C"] @ x <= at["u"] + 1e-15).all(), case
            assert (at["lb"] <= x).all(), case
            assert (x <= at["ub"]).all(), case


def test_rows_of_one_side_only_move_the_joints_between() -> None:
    """Self-collision rows of the upper arm and the hand: A1 and A2 carry both, A7 neither."""
    robot = arm("lbr_med14")
    constraint = SelfCollision(pairs=(("hand", "upper arm"),), retreat=False)
    assert [pair[0].name for pair in constraint.checked_pairs(robot)] == ["upper arm"]
    row = RowsOf(constraint, robot).lowered.function.sparsity_out("C")
    assert row.shape == (1, 7)
    C = RowsOf(constraint, robot)(BENT)["C"][0]
    np.testing.assert_array_equal(C[[0, 1, 6]], 0.0)
    assert np.abs(C[2:6]).max() > 0.01


def test_symbols_are_shared_with_the_tick() -> None:
    """No second set of sines and cosines: the LBR's collision rows cost about what their geometry does."""
    lowered = RowsOf(SelfCollision(), arm("lbr_med14")).lowered
    function = lowered.function
    operations = [function.instruction_id(i) for i in range(function.n_instructions())]
    assert operations.count(ca.OP_SIN) <= 6
    assert function.n_instructions() < 3500


def test_a_measure_without_a_gradient_has_no_row() -> None:
    """The UR5e with its wrist singular: the locked rows lose rank, and the guided measure jumps."""
    robot = arm("ur5e")
    q = np.array([0.3, -1.2, 1.5, 0.4, 0.0, 0.7])
    rows = RowsOf(SingularityAvoidance(rows="guided"), robot, "fix-orientation")
    at, beside = rows(q, v=[0.1, 0.0, 0.0]), rows(q + 0.3, v=[0.1, 0.0, 0.0])
    assert np.isfinite(at["C"]).all()
    assert np.abs(at["C"][0, :6]).max() < 30.0
    assert 0.01 < np.abs(beside["C"][0, :6]).max() < 10.0
