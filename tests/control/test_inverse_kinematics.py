"""Inverse kinematics within limits: the report's example, other arms, points out of reach, bad input."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from kinqp.control import IkStatus, InverseKinematics, SpiralPath, inverse_kinematics, relax
from kinqp.formulations import ModeError
from kinqp.robots import load_robot
from tests.robots.arms import arm

DAVINCI = load_robot("davinci5")
START = [1.0, 0.180, -0.2, 2.1, 0.0]
TARGET = 1e-3 * np.array([33.354, 335.1, -16.579])


@pytest.fixture(scope="module")
def davinci() -> InverseKinematics:
    return InverseKinematics(DAVINCI)


def within(robot, q) -> bool:
    return bool((q >= robot.q_min).all() and (q <= robot.q_max).all())


def angle_between(a, b) -> float:
    # From the chord, as the arc cosine of the trace would lose half the digits.
    return 2.0 * np.arcsin(min(1.0, np.linalg.norm(a - b) / (2.0 * np.sqrt(2.0))))


def test_the_reports_example() -> None:
    """9,946 iterations to 4.998 mm, out of bounds, there; at most 30 QPs to 1e-6 mm within bounds here."""
    assert not within(DAVINCI, START)
    result = inverse_kinematics(DAVINCI, TARGET, START, "position")
    assert result.status is IkStatus.REACHED
    assert result.total_steps <= 30
    assert within(DAVINCI, result.q)
    assert np.linalg.norm(DAVINCI.pose(result.q)[:3, 3] - TARGET) < 1e-9
    assert all(within(DAVINCI, q) for q in result.history)
    assert len(result.history) == result.steps + 1


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_any_reachable_point_is_reached_from_anywhere(davinci, seed) -> None:
    rng = np.random.default_rng(seed)
    target = DAVINCI.pose(DAVINCI.random_configuration(rng))[:3, 3]
    result = davinci(target, rng.uniform(-3.0, 3.0, 5))
    assert result.status is IkStatus.REACHED
    assert within(DAVINCI, result.q)
    assert np.linalg.norm(DAVINCI.pose(result.q)[:3, 3] - target) <= 1e-10


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "kinova"])
def test_full_poses_of_other_arms(name) -> None:
    robot = arm(name)
    ik, rng = InverseKinematics(robot, "free"), np.random.default_rng(1)
    for _ in range(8):
        goal = robot.pose(robot.random_configuration(rng))
        result = ik(goal, robot.random_configuration(rng))
        there = robot.pose(result.q)
        assert result.status is IkStatus.REACHED
        assert within(robot, result.q)
        assert np.linalg.norm(there[:3, 3] - goal[:3, 3]) <= 1e-10
        assert angle_between(there[:3, :3], goal[:3, :3]) <= 2e-9


@pytest.mark.parametrize(
    ("name", "mode"),
    [(name, "free") for name in ("lbr_med14", "ur5e", "panda")]
    + [("davinci5", "position"), ("mixed_to_tool", "position")],
)
def test_how_fast_the_joints_may_be_does_not_matter(name, mode) -> None:
    """The same steps to the same posture, bit for bit, with a thousandth of the speed and with ten times of it."""
    robot, rng = arm(name), np.random.default_rng(6)
    solvers = [
        InverseKinematics(dataclasses.replace(robot, qd_max=share * robot.qd_max), mode, starts=3)
        for share in (1.0, 1e-3, 10.0)
    ]
    for _ in range(3):
        start, goal = robot.random_configuration(rng), robot.pose(robot.random_configuration(rng))
        target = goal if mode == "free" else goal[:3, 3]
        first, *others = (solver(target, start) for solver in solvers)
        for other in others:
            np.testing.assert_array_equal(other.history, first.history)
            assert (other.status, other.starts) == (first.status, first.starts)


SLIDE = """<robot name="slide">{links}
<joint name="x" type="prismatic"><parent link="l0"/><child link="l1"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="{length}" velocity="{speed}" effort="1"/></joint>
<joint name="a" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0 0 .3"/><axis xyz="0 0 1"/>
  <limit lower="-2.9" upper="2.9" velocity="2" effort="1"/></joint>
<joint name="b" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0 0 .1"/><axis xyz="0 1 0"/>
  <limit lower="-2.9" upper="2.9" velocity="2" effort="1"/></joint>
<joint name="c" type="revolute"><parent link="l3"/><child link="l4"/><origin xyz="0 0 .4"/><axis xyz="0 1 0"/>
  <limit lower="-2.9" upper="2.9" velocity="2" effort="1"/></joint>
<joint name="t" type="fixed"><parent link="l4"/><child link="l5"/><origin xyz="0 0 .4"/></joint></robot>"""


@pytest.mark.parametrize("length", [2.0, 50.0, 1e6])
@pytest.mark.parametrize("speed", [1.0, 0.1, 0.001])
def test_a_slow_rail_is_used_from_the_first_start(length, speed, tmp_path) -> None:
    """Three quarters of the rail, at most 75 m: the rail alone could go there, the other joints as they are."""
    path = tmp_path / "slide.urdf"
    links = "".join(f'<link name="l{i}"/>' for i in range(6))
    path.write_text(SLIDE.format(links=links, length=length, speed=speed))
    robot, start = load_robot(path), [0.1, 0.3, 0.8, 1.0]
    target = robot.pose(start)[:3, 3] + [min(0.75 * length, 75.0), 0.0, 0.0]
    result = InverseKinematics(robot, "position")(target, start, only=True)
    assert result.status is IkStatus.REACHED
    assert within(robot, result.q)
    assert result.steps <= 20


def test_a_singular_start_on_limits_gets_away() -> None:
    robot = load_robot("lbr_med14")
    rng = np.random.default_rng(2)
    ik = InverseKinematics(robot, "free")
    for start in (np.zeros(7), robot.q_min, robot.q_max):
        goal = robot.pose(0.9 * robot.random_configuration(rng))
        assert ik(goal, start).status is IkStatus.REACHED


def test_out_of_reach_ends_where_nothing_within_limits_helps(davinci) -> None:
    """The projected gradient vanishes, and bounded least squares from many starts gets no nearer."""
    rng = np.random.default_rng(3)
    for target in ([0.0, 0.0, 0.0], [0.21, 0.2, -0.017], [3.0, -4.0, 5.0]):
        result = davinci(target, DAVINCI.random_configuration(rng))
        assert result.status is IkStatus.NEAREST
        assert within(DAVINCI, result.q)
        missing = np.array(target) - DAVINCI.pose(result.q)[:3, 3]
        uphill = DAVINCI.jacobian(result.q)[:3].T @ missing
        free = np.clip(result.q + uphill, DAVINCI.q_min, DAVINCI.q_max) - result.q
        assert np.abs(free).max() < 1e-5 * np.linalg.norm(missing)
        best = min(
            np.linalg.norm(
                least_squares(
                    lambda q, goal: DAVINCI.pose(q)[:3, 3] - goal,
                    DAVINCI.random_configuration(rng),
                    bounds=(DAVINCI.q_min, DAVINCI.q_max),
                    x_scale=DAVINCI.q_max - DAVINCI.q_min,
                    xtol=1e-15,
                    ftol=1e-15,
                    gtol=1e-15,
                    args=(target,),
                ).fun
            )
            for _ in range(6)
        )
        assert result.error == pytest.approx(best, abs=1e-7)
        assert result.error == pytest.approx(np.linalg.norm(missing), rel=1e-12)


def test_other_starts_leave_a_local_minimum(davinci) -> None:
    """From this corner of the joint ranges some points of the report's spiral seem out of reach, and are not."""
    targets = SpiralPath((0.23, 0.2, -0.0145), 0.02, 0.75e-3, 1.6 * np.pi, 2.6 * np.pi).points(12)
    corner = [np.deg2rad(39.8), 0.0, np.deg2rad(-84.6), DAVINCI.q_max[3], 0.0]
    stuck = [target for target in targets if davinci(target, corner, only=True).status is IkStatus.NEAREST]
    assert stuck
    for target in stuck:
        result = davinci(target, corner)
        assert result.status is IkStatus.REACHED
        assert result.start > 0
        assert result.start == result.starts - 1


def test_at_the_target_nothing_is_solved(davinci) -> None:
    q = DAVINCI.random_configuration(np.random.default_rng(4))
    result = davinci(DAVINCI.pose(q)[:3, 3], q)
    assert result.total_steps == 0
    np.testing.assert_array_equal(result.q, q)


def test_same_input_same_result(davinci) -> None:
    again = InverseKinematics(DAVINCI)
    for target in (TARGET, [0.0, 0.0, 0.0]):
        np.testing.assert_array_equal(davinci(target, START).q, again(target, START).q)


def test_locked_rows_stay_those_of_the_start() -> None:
    robot = load_robot("lbr_med14")
    q = np.deg2rad([10.0, 40.0, 5.0, -80.0, 10.0, 30.0, 20.0])
    start = robot.pose(q)
    target = start[:3, 3] + [0.03, -0.05, 0.02]
    kept = robot.pose(inverse_kinematics(robot, target, q, "fix-orientation").q)
    np.testing.assert_allclose(kept[:3, 3], target, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(kept[:3, :3], start[:3, :3], rtol=0.0, atol=1e-8)
    # Along the tool's z only: the target's share of it.
    on_line = robot.pose(inverse_kinematics(robot, target, q, "line:z").q)
    z = start[:3, 2]
    np.testing.assert_allclose(on_line[:3, 3], start[:3, 3] + z * (z @ (target - start[:3, 3])), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(on_line[:3, :3], start[:3, :3], rtol=0.0, atol=1e-8)


def test_too_few_steps_are_said() -> None:
    result = InverseKinematics(DAVINCI, max_steps=1, starts=1)(TARGET, START)
    assert result.status is IkStatus.MAX_STEPS
    assert within(DAVINCI, result.q)


BAD_POSE = np.diag([1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda ik: ik([0.0, 0.0], START), ValueError, r"^target: expected 3 coordinates"),
        (lambda ik: ik([0.0, np.nan, 0.0], START), ValueError, r"^target: expected 3 coordinates"),
        (lambda ik: ik(BAD_POSE, START), ValueError, r"^target: expected a homogeneous pose"),
        (lambda ik: ik(TARGET, [0.0] * 4), ValueError, r"^q0: expected shape \(5,\)"),
        (lambda ik: ik(TARGET, [np.inf] * 5), ValueError, r"^q0: expected finite"),
        (
            lambda _: inverse_kinematics(DAVINCI, TARGET, START, "free"),
            ValueError,
            r"^target: expected a \(4, 4\) pose",
        ),
        (lambda _: InverseKinematics(DAVINCI, "rcm:0.1"), ModeError, r"^mode: inverse kinematics expected"),
        (lambda _: InverseKinematics(DAVINCI, tolerance=0.0), ValueError, r"^tolerance: expected a positive"),
        (lambda _: InverseKinematics(DAVINCI, starts=0), ValueError, r"^starts: expected a positive"),
        (lambda ik: relax(ik, START[:4], START), ValueError, r"^q: expected shape"),
    ],
)
def test_bad_input(davinci, call, error, message) -> None:
    with pytest.raises(error, match=message):
        call(davinci)


def test_relaxing_finds_the_nearest_of_all_self_motions(davinci) -> None:
    """The tool stays; along the one-dimensional self-motion, found by a dense scan, nothing is nearer."""
    span = DAVINCI.q_max - DAVINCI.q_min
    posture = 0.5 * (DAVINCI.q_min + DAVINCI.q_max)
    rng = np.random.default_rng(5)
    for _ in range(5):
        q = DAVINCI.random_configuration(rng)
        tool = DAVINCI.pose(q)[:3, 3]
        relaxed, _ = relax(davinci, q, posture)
        assert within(DAVINCI, relaxed)
        np.testing.assert_allclose(DAVINCI.pose(relaxed)[:3, 3], tool, rtol=0.0, atol=1e-9)
        # For every theta11 the rest follows: z gives theta10, the radius d9, the angle theta8.
        theta11 = np.linspace(DAVINCI.q_min[3], DAVINCI.q_max[3], 4001)
        sine = tool[2] / (0.018 * np.sin(theta11))
        theta11, sine = theta11[np.abs(sine) <= 1.0], sine[np.abs(sine) <= 1.0]
        theta10 = np.arcsin(sine)
        u = 0.3 - 0.018 * np.cos(theta10) * np.sin(theta11)
        radius2 = tool[0] ** 2 + tool[1] ** 2
        ok = u**2 <= radius2
        best = np.inf
        for sign in (1.0, -1.0):
            w = sign * np.sqrt(radius2 - u[ok] ** 2)
            found = np.column_stack(
                [
                    np.arctan2(tool[1], tool[0]) - np.arctan2(w, u[ok]),
                    w - 0.018 * np.cos(theta11[ok]),
                    theta10[ok],
                    theta11[ok],
                    np.full(ok.sum(), posture[4]),
                ]
            )
            inside = ((found >= DAVINCI.q_min) & (found <= DAVINCI.q_max)).all(axis=1)
            distances = np.linalg.norm((found[inside] - posture) / span, axis=1)
            best = min(best, distances.min(initial=np.inf))
        assert np.linalg.norm((relaxed - posture) / span) <= best + 1e-4
