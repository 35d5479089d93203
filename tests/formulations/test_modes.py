"""Motion modes: their rows, their spelling, and what their rows mean, judged by differencing the pose."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinqp.formulations import MODE_NAMES, Mode, ModeError
from tests.finite_differences import difference_jacobian
from tests.formulations.reference import MODES, rows_at
from tests.robots.arms import arm

SETTINGS = settings(max_examples=80, deadline=None, derandomize=True)
FRAMES = st.sampled_from(["world", "tool"])
FINITE = st.floats(allow_nan=False, allow_infinity=False)
NORMALS = st.lists(FINITE, min_size=3, max_size=3).filter(any)
ROBOT = arm("lbr_med14")


def random_poses(count: int) -> list[np.ndarray]:
    rng = np.random.default_rng(7)
    return [ROBOT.pose(ROBOT.random_configuration(rng)) for _ in range(count)]


@pytest.mark.parametrize(
    ("mode", "free", "fixed", "frame"),
    [
        (Mode.free(), "vx vy vz wx wy wz", "", "world"),
        (Mode.position(), "vx vy vz", "", "world"),
        (Mode.fix_orientation(), "vx vy vz", "wx wy wz", "world"),
        (Mode.fix_position(), "wx wy wz", "vx vy vz", "world"),
        (Mode.line("x"), "vx", "vy vz wx wy wz", "tool"),
        (Mode.line("y"), "vy", "vx vz wx wy wz", "tool"),
        (Mode.line("z"), "vz", "vx vy wx wy wz", "tool"),
        (Mode.line("z", frame="world"), "vz", "vx vy wx wy wz", "world"),
        (Mode.plane([0, 1, 0]), "v1 v2", "vn w1 w2 wn", "world"),
        (Mode.rcm(0.1), "vz wx wy wz", "vx vy", "tool"),
    ],
)
def test_rows(mode: Mode, free: str, fixed: str, frame: str) -> None:
    assert mode.free_names == tuple(free.split())
    assert [mode.row_names[row] for row in mode.fixed_rows] == fixed.split()
    assert (mode.m_free, mode.m_fixed) == (len(free.split()), len(fixed.split()))
    assert mode.frame == frame


def test_every_name_is_covered_here_and_parsed() -> None:
    assert {Mode.parse(text).name for text in MODES} == set(MODE_NAMES)


@pytest.mark.parametrize("text", [*MODES, "fix-position@tool", "line:x@world", "plane:0,1,0@tool", "free@tool"])
def test_writes_what_it_reads(text: str) -> None:
    assert str(Mode.parse(text)) == text


@pytest.mark.parametrize(
    ("text", "mode"),
    [
        ("line", Mode.line("z")),
        ("line@world", Mode.line("z", frame="world")),
        ("fix-position@world", Mode.fix_position()),
        ("rcm:0.1@tool", Mode.rcm(0.1)),
        ("rcm:1e-1", Mode.rcm(0.1)),
    ],
)
def test_other_spellings(text: str, mode: Mode) -> None:
    assert Mode.parse(text) == mode


@SETTINGS
@given(normal=NORMALS, frame=FRAMES)
def test_plane_survives_being_written(normal: list[float], frame: str) -> None:
    mode = Mode.plane(normal, frame)  # type: ignore[arg-type]  # any of the two
    assert Mode.parse(str(mode)) == mode


@SETTINGS
@given(depth=FINITE)
def test_rcm_survives_being_written(depth: float) -> None:
    mode = Mode.rcm(depth)
    assert Mode.parse(str(mode)) == mode
    assert mode.depth == depth


@SETTINGS
@given(axis=st.sampled_from(["x", "y", "z"]), frame=FRAMES)
def test_line_survives_being_written(axis: str, frame: str) -> None:
    mode = Mode.line(axis, frame)  # type: ignore[arg-type]  # any of the two
    assert Mode.parse(str(mode)) == mode
    assert mode.frame == frame


@SETTINGS
@given(name=st.sampled_from(["free", "position", "fix-orientation", "fix-position"]), frame=FRAMES)
def test_frame_survives_being_written(name: str, frame: str) -> None:
    mode = Mode.parse(f"{name}@{frame}")
    assert mode.frame == frame
    assert Mode.parse(str(mode)) == mode


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "mode: expected one of free, position, .*, got ''"),
        ("fix-position@", "mode: expected one of free, .*, got 'fix-position@'"),
        ("free:", "mode: expected one of free, .*, got 'free:'"),
        ("wiggle", "mode: expected one of free, .*, got 'wiggle'"),
        ("free:1", "mode free: expected no argument, got '1'"),
        ("position:z", "mode position: expected no argument, got 'z'"),
        ("fix-orientation:z", "mode fix-orientation: expected no argument, got 'z'"),
        ("fix-position:z", "mode fix-position: expected no argument, got 'z'"),
        ("free@base", "frame: expected 'world' or 'tool', got 'base'"),
        ("line:z@base", "frame: expected 'world' or 'tool', got 'base'"),
        ("line:w", "line axis: expected one of x, y, z, got 'w'"),
        ("plane", r"mode plane: expected 3 number\(s\) as in plane:0,1,0, got ''"),
        ("plane:0,1", r"mode plane: expected 3 number\(s\) .*, got '0,1'"),
        ("plane:a,b,c", r"mode plane: expected 3 number\(s\) .*, got 'a,b,c'"),
        ("plane:0,0,0", "plane normal: expected 3 finite numbers, not all zero"),
        ("plane:0,nan,0", "plane normal: expected 3 finite numbers"),
        ("plane:0,inf,0", "plane normal: expected 3 finite numbers"),
        ("rcm", r"mode rcm: expected 1 number\(s\) as in rcm:0.1, got ''"),
        ("rcm:deep", r"mode rcm: expected 1 number\(s\) .*, got 'deep'"),
        ("rcm:nan", "rcm depth: expected a finite number of metres, got nan"),
        ("rcm:0.1@world", "mode rcm: its frame is always the tool, got 'world'"),
    ],
)
def test_refuses_text(text: str, message: str) -> None:
    with pytest.raises(ModeError, match=f"^{message}"):
        Mode.parse(text)


@pytest.mark.parametrize("normal", [[0, 1], [[0, 1, 0]], ["a", "b", "c"], [0, None, 1], [[1], [2, 3], []], None])
def test_refuses_a_normal_that_is_not_three_numbers(normal: object) -> None:
    with pytest.raises(ModeError, match=r"^plane normal: expected (3 finite numbers, not all zero|real numbers), got "):
        Mode.plane(normal)  # type: ignore[arg-type]  # the point of the test


@pytest.mark.parametrize("depth", [np.inf, -np.inf, "0.1", None])
def test_refuses_a_depth_that_is_not_a_number(depth: object) -> None:
    with pytest.raises(ModeError, match=r"^rcm depth: expected a finite number of metres, got "):
        Mode.rcm(depth)  # type: ignore[arg-type]  # the point of the test


@SETTINGS
@given(normal=NORMALS)
def test_plane_axes(normal: list[float]) -> None:
    axes = np.array(Mode.plane(normal).axes)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-14)
    scaled = np.array(normal) / np.abs(normal).max()
    np.testing.assert_allclose(axes[2], scaled / np.linalg.norm(scaled), atol=1e-15)


@pytest.mark.parametrize(("normal", "first", "second"), [("z", "x", "y"), ("x", "y", "z"), ("y", "z", "x")])
def test_plane_axes_of_coordinate_planes(normal: str, first: str, second: str) -> None:
    unit = dict(zip("xyz", np.eye(3), strict=True))
    for sign in (1.0, -1.0):
        axes = np.array(Mode.plane(list(sign * unit[normal])).axes, dtype=float)
        np.testing.assert_array_equal(axes, [unit[first], sign * unit[second], sign * unit[normal]])


def test_plane_does_not_depend_on_the_length_of_the_normal() -> None:
    expected = np.array(Mode.plane([3, -4, 1]).axes)
    for length in (1e-300, 1e-3, 1e300):
        np.testing.assert_allclose(Mode.plane([3 * length, -4 * length, length]).axes, expected, atol=1e-15)


def test_pictures() -> None:
    assert Mode.fix_orientation().picture() == "vx [#] vy [#] vz [#] wx [x] wy [x] wz [x]"
    assert Mode.position().picture() == "vx [#] vy [#] vz [#] wx [ ] wy [ ] wz [ ]"
    assert Mode.rcm(0.1).picture() == "vx [x] vy [x] vz [#] wx [#] wy [#] wz [#]"
    assert Mode.plane([0, 0, 1]).picture() == "v1 [#] v2 [#] vn [x] w1 [x] w2 [x] wn [x]"


@pytest.mark.parametrize("text", [*MODES, "fix-orientation@tool", "plane:1,-2,0.5@tool", "line:y@world", "rcm:0"])
def test_symbolic_map_equals_the_numeric_one(text: str) -> None:
    mode, pose = Mode.parse(text), ca.SX.sym("pose", 4, 4)
    symbolic = ca.Function("map", [pose], [ca.densify(mode.twist_map(pose))])
    for at in random_poses(20):
        np.testing.assert_allclose(np.array(symbolic(at)), mode.twist_map_at(at), atol=1e-15)


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e"])
@pytest.mark.parametrize("text", [*MODES, "fix-position@tool", "plane:1,-2,0.5@tool", "line:y@world", "rcm:0.3"])
def test_rows_are_what_differencing_the_pose_says(name: str, text: str) -> None:
    mode, robot = Mode.parse(text), arm(name)
    rng = np.random.default_rng(3)
    for _ in range(3):
        q, qd = robot.random_configuration(rng), rng.normal(size=robot.nv)

        def moving(t: np.ndarray, q: np.ndarray = q, qd: np.ndarray = qd) -> np.ndarray:
            return robot.pose(q + t[0] * qd)

        pose, rate = robot.pose(q), difference_jacobian(moving, np.zeros(1))[..., 0]
        R = pose[:3, :3]
        spin = rate[:3, :3] @ R.T  # [omega]x, since dR/dt = [omega]x R
        omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        # The point: the tool centre point, or `depth` along the tool's z from it; dz/dt is the third column's rate.
        velocity = rate[:3, 3] + mode.depth * rate[:3, 2]
        axes = np.array(mode.axes) @ (R.T if mode.frame == "tool" else np.eye(3))
        expected = np.concatenate((axes @ velocity, axes @ omega))
        twist = mode.twist_map_at(pose) @ robot.jacobian(q) @ qd
        np.testing.assert_allclose(twist, expected, atol=1e-9)
        J_free, J_fixed = rows_at(robot, mode, q)
        np.testing.assert_allclose(J_free @ qd, expected[list(mode.free_rows)], atol=1e-9)
        np.testing.assert_allclose(J_fixed @ qd, expected[list(mode.fixed_rows)], atol=1e-9)


def test_rcm_keeps_the_pivot_on_the_axis() -> None:
    """Motion within the null space of the locked rows moves the shaft through the pivot only along itself."""
    rng = np.random.default_rng(5)
    mode = Mode.rcm(-0.2)
    for _ in range(10):
        q = ROBOT.random_configuration(rng)
        _, J_fixed = rows_at(ROBOT, mode, q)
        qd = (np.eye(7) - np.linalg.pinv(J_fixed) @ J_fixed) @ rng.normal(size=7)
        step = 1e-5
        pose, after = ROBOT.pose(q), ROBOT.pose(q + step * qd)
        moved = (after[:3, 3] - 0.2 * after[:3, 2]) - (pose[:3, 3] - 0.2 * pose[:3, 2])
        sideways = moved - pose[:3, 2] * (pose[:3, 2] @ moved)
        assert np.linalg.norm(sideways) < 100 * step**2  # second order in the step; |qd| and lengths are of order 1
        assert np.linalg.norm(after[:3, 2] - pose[:3, 2]) > 0.01 * step  # the shaft does turn


@SETTINGS
@given(seed=st.integers(0, 2**31), normal=NORMALS)
def test_tool_frame_is_the_world_frame_at_the_identity_and_turns_with_the_tool(seed: int, normal: list[float]) -> None:
    pose = ROBOT.pose(ROBOT.random_configuration(np.random.default_rng(seed)))
    R = pose[:3, :3]
    in_world, in_tool = Mode.plane(normal), Mode.plane(normal, "tool")
    np.testing.assert_allclose(in_tool.twist_map_at(np.eye(4)), in_world.twist_map_at(np.eye(4)), atol=1e-15)
    # The tool's twist in world axes, turned into the tool, then read along the same axes.
    turn = np.kron(np.eye(2), R.T)
    np.testing.assert_allclose(in_tool.twist_map_at(pose), in_world.twist_map_at(pose) @ turn, atol=1e-14)
