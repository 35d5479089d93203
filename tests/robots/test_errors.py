"""Every way in which loading a robot fails says what was expected, what was got, and what to do."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
import pytest

from kinqp.robots import Robot, RobotError, load_robot
from tests.robots.arms import example_urdf

if TYPE_CHECKING:
    from pathlib import Path

_LIMIT = '<limit lower="-1" upper="1" velocity="2" effort="3"/>'
_INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def _joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = _LIMIT) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 0.1" rpy="0 0 0"/>{inside}</joint>'
    )


def _robot(*joints: str, links: str = "abcd") -> str:
    body = "".join(f'<link name="{link}">{_INERTIAL}</link>' for link in links)
    return f'<robot name="test">{body}{"".join(joints)}</robot>'


def _load(folder: Path, text: str, **options: Any) -> Any:
    path = folder / "test.urdf"
    path.write_text(text, encoding="utf-8")
    return load_robot(path, **options)


_FIRST = _joint("ab", "a", "b")
_SECOND = _joint("bc", "b", "c")
_THIRD = _joint("cd", "c", "d")


def test_a_plain_chain_loads(tmp_path: Path) -> None:
    robot = _load(tmp_path, _robot(_FIRST, _SECOND, _THIRD))
    assert (robot.name, robot.tip, robot.joint_names) == ("test", "d", ("ab", "bc", "cd"))
    np.testing.assert_array_equal(robot.tau_max, [3.0, 3.0, 3.0])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "lbr_med41",
            r"^robot: expected a known name or the path of a URDF file, got 'lbr_med41'; "
            r"did you mean 'lbr_med14'\? "
            r"Available: davinci5, lbr_med14, lbr_med7, ur5e$",
        ),
        ("UR5E", r"did you mean 'ur5e'\?"),
        ("zzz", r"got 'zzz'; available: davinci5, lbr_med14, lbr_med7, ur5e$"),
        ("", r"got ''; available: "),
    ],
)
def test_unknown_name(name: str, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        load_robot(name)


def test_missing_file(tmp_path: Path) -> None:
    path = tmp_path / "none.urdf"
    for given in (path, str(path)):
        with pytest.raises(RobotError, match=r"none.urdf: expected a URDF file, got no such file; check the path$"):
            load_robot(given)


def test_unreadable_file(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match=r": expected a readable URDF file, got .*; check the file$"):
        load_robot(tmp_path)
    path = tmp_path / "binary.urdf"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RobotError, match=r"binary.urdf: expected a readable URDF file, got .*; check the file$"):
        load_robot(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"test.urdf: expected a URDF file, got invalid XML \(no element found"),
        ("<robot>", r"test.urdf: expected a URDF file, got invalid XML"),
        ("<sdf/>", r"test.urdf: expected a URDF file with root element <robot>, got <sdf>$"),
        (
            '<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>',
            r"got xacro macros; expand them first with the xacro tool$",
        ),
        (
            '<robot name="x"/>',
            r"expected one link that no joint carries, got none; connect the links to one tree$",
        ),
        (
            _robot(_FIRST),
            r"expected one link that no joint carries, got a, c, d; connect the links to one tree$",
        ),
        (
            _robot(_FIRST, _SECOND, _joint("ca", "c", "a"), links="abc"),
            r"link that no joint carries, got none; ",
        ),
        (
            _robot(_FIRST, _joint("cd", "c", "d"), _joint("dc", "d", "c")),
            r"a tree of links, got a loop through link '",
        ),
        (_robot(_joint("ax", "a", "x"), links="a"), r"joint 'ax' expected a link of the file, got 'x'$"),
        (_robot(_FIRST, _joint("cb", "c", "b")), r"expected one joint to carry link 'b', got 'ab' and 'cb'$"),
        (
            _robot(_FIRST, links="ab").replace('xyz="0 0 0.1"', 'xyz="one two"'),
            r"joint 'ab': expected xyz of its <origin> as three finite numbers of at most 1e\+06, got 'one two'$",
        ),
    ],
)
def test_invalid_file(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(RobotError, match=message):
        _load(tmp_path, text)


def test_unknown_tip(tmp_path: Path) -> None:
    with pytest.raises(
        RobotError, match=r"^tip: expected a link of .*test.urdf, got 'hand'; ends: d; all links: a, b, c, d$"
    ):
        _load(tmp_path, _robot(_FIRST, _SECOND, _THIRD), tip="hand")
    with pytest.raises(RobotError, match=r"^tip: expected 'tool', the only frame of davinci5, got 'hand'$"):
        load_robot("davinci5", tip="hand")


def test_branched_tree_needs_a_tip(tmp_path: Path) -> None:
    text = _robot(_FIRST, _SECOND, _joint("bd", "b", "d"))
    with pytest.raises(
        RobotError,
        match=r"^tip: expected a link's name because the tree branches, got none; choose one of c, d$",
    ):
        _load(tmp_path, text)
    assert _load(tmp_path, text, tip="d").joint_names == ("ab", "bd")
    with pytest.raises(RobotError, match=r"choose one of panda_hand_tcp, panda_leftfinger, panda_rightfinger$"):
        load_robot(example_urdf("panda"))


def test_a_stub_on_the_base_is_no_branch(tmp_path: Path) -> None:
    assert _load(tmp_path, _robot(_FIRST, _SECOND, _joint("ad", "a", "d", "fixed"))).tip == "c"


def test_no_joint_between_base_and_tip(tmp_path: Path) -> None:
    fixed = _joint("ab", "a", "b", "fixed", "")
    with pytest.raises(RobotError, match=r"expected at least one moving joint, got none between base and any tip$"):
        _load(tmp_path, _robot(fixed, links="ab"))
    text = _robot(fixed, _SECOND, links="abc")
    for tip in "ab":
        with pytest.raises(RobotError, match=f"^tip: expected a link that a joint can move, got '{tip}' .*; ends: c$"):
            _load(tmp_path, text, tip=tip)


def test_floating_base(tmp_path: Path) -> None:
    with pytest.raises(
        RobotError,
        match=r"^joint 'ab': expected a base fixed in the world, got a floating joint; make it a fixed",
    ):
        _load(tmp_path, _robot(_joint("ab", "a", "b", "floating"), _SECOND, links="abc"))


@pytest.mark.parametrize("kind", ["planar", "spherical", "ball", ""])
def test_unsupported_joint(tmp_path: Path, kind: str) -> None:
    with pytest.raises(
        RobotError,
        match=rf"^joint 'bc': expected one of revolute, prismatic, continuous, fixed between base and tip, "
        rf"got '{kind}'; ",
    ):
        _load(tmp_path, _robot(_FIRST, _joint("bc", "b", "c", kind), links="abc"))


def test_mimic_joint_on_the_chain(tmp_path: Path) -> None:
    mimic = _joint("bc", "b", "c", inside=_LIMIT + '<mimic joint="ab"/>')
    text = _robot(_FIRST, mimic, links="abc")
    with pytest.raises(RobotError, match=r"^joint 'bc': expected an independent joint .*, got one that mimics 'ab'; "):
        _load(tmp_path, text)
    assert _load(tmp_path, text, tip="b").nv == 1


@pytest.mark.parametrize(
    ("kind", "inside", "message"),
    [
        (
            "revolute",
            "",
            r"expected limits, got none; add a <limit> element with lower, upper, velocity and effort$",
        ),
        (
            "prismatic",
            "",
            r"expected limits, got none; add a <limit> element with lower, upper, velocity and effort$",
        ),
        ("continuous", "", r"expected limits, got none; add a <limit> element with velocity and effort$"),
        (
            "revolute",
            '<limit lower="-1" upper="1" effort="1"/>',
            r"expected its velocity limit, got none; set velocity",
        ),
        (
            "revolute",
            '<limit lower="-1" upper="1" velocity="1"/>',
            r"expected its effort limit, got none; set effort",
        ),
        (
            "revolute",
            '<limit upper="1" velocity="1" effort="1"/>',
            r"expected its lower limit, got none; set lower in",
        ),
        (
            "revolute",
            '<limit lower="1" velocity="1" effort="1"/>',
            r"expected its upper limit, got none; set upper in",
        ),
        (
            "continuous",
            '<limit velocity="0" effort="1"/>',
            r"expected a positive velocity limit, got 0; set velocity in its <limit> element$",
        ),
        (
            "continuous",
            '<limit velocity="1" effort="-2"/>',
            r"expected a positive effort limit, got -2; set effort",
        ),
        (
            "continuous",
            '<limit velocity="nan" effort="2"/>',
            r"expected a positive velocity limit, got nan; ",
        ),
        (
            "continuous",
            '<limit velocity="inf" effort="2"/>',
            r"expected a positive velocity limit, got inf; ",
        ),
        (
            "continuous",
            '<limit velocity="fast" effort="2"/>',
            r"expected a number for its velocity limit, got 'fast'$",
        ),
        (
            "revolute",
            '<limit lower="1" upper="1" velocity="1" effort="1"/>',
            r"expected finite limits lower < upper, got lower=1 and upper=1; correct its <limit> element$",
        ),
        (
            "prismatic",
            '<limit lower="-inf" upper="1" velocity="1" effort="1"/>',
            r"got lower=-inf and upper=1; ",
        ),
        (
            "revolute",
            _LIMIT + '<axis xyz="0 0 0"/>',
            r"axis of three numbers that are not all zero, got '0 0 0'$",
        ),
        (
            "revolute",
            _LIMIT + '<axis xyz="0 1"/>',
            r"axis of three numbers that are not all zero, got '0 1'$",
        ),
        (
            "revolute",
            _LIMIT + '<axis xyz="a b c"/>',
            r"axis of three numbers that are not all zero, got 'a b c'$",
        ),
        ("revolute", _LIMIT + '<axis xyz=""/>', r"axis of three numbers that are not all zero, got ''$"),
        ("revolute", _LIMIT + "<axis/>", r"expected the attribute xyz and no other in its <axis> element, got none; "),
        ("prismatic", _LIMIT + '<axis xzy="0 0 1"/>', r"expected the attribute xyz and no other in .*, got 'xzy'; "),
        ("revolute", _LIMIT + '<axis xyz="0 0 1" frame="a"/>', r"no other in .*, got 'xyz', 'frame'; "),
        (
            "revolute",
            _LIMIT + '<axis xyz="0 0 1e-9"/>',
            r"expected an axis of length 1 .* got '0 0 1e-9' of length 1e-09$",
        ),
        ("revolute", _LIMIT + '<axis xyz="0 0 -1e200"/>', r"got '0 0 -1e200' of length 1e\+200$"),
        ("revolute", _LIMIT + '<axis xyz="1 nan 0"/>', r"axis of three numbers that are not all zero, got '1 nan 0'$"),
    ],
)
def test_missing_or_useless_limit(tmp_path: Path, kind: str, inside: str, message: str) -> None:
    with pytest.raises(RobotError, match="^joint 'bc': .*" + message):
        _load(tmp_path, _robot(_FIRST, _joint("bc", "b", "c", kind, inside), links="abc"))


@pytest.mark.parametrize("kind", ["fixed", "revolute"])
@pytest.mark.parametrize(
    ("origin", "message"),
    [
        ('<origin xzy="0 0 1"/>', r"expected xyz and rpy in its <origin>, got 'xzy'; "),
        ('<origin xyz="0 0 1" rqy="0 0 0"/>', r"expected xyz and rpy in its <origin>, got 'rqy'; "),
        ('<origin xyz="0 0"/>', r"expected xyz of its <origin> as three finite numbers of at most 1e\+06, got '0 0'$"),
        ('<origin xyz="0 0 1e7"/>', r"of at most 1e\+06, got '0 0 1e7'$"),
        (
            '<origin rpy="0 0 inf"/>',
            r"expected rpy of its <origin> as three finite numbers of at most 1e\+06, got '0 0 inf'$",
        ),
    ],
)
def test_an_origin_that_would_be_taken_for_none(tmp_path: Path, kind: str, origin: str, message: str) -> None:
    second = _SECOND.replace('<origin xyz="0 0 0.1" rpy="0 0 0"/>', origin).replace("revolute", kind)
    with pytest.raises(RobotError, match="^joint 'bc': .*" + message):
        _load(tmp_path, _robot(_FIRST, second, links="abc"))


@pytest.mark.parametrize("axis", ["0 3e-3 -4e-3", "0 30 -40", "1 1 1", "0 0.6 -0.8001"])
def test_an_axis_of_another_length_counts_as_its_direction(tmp_path: Path, axis: str) -> None:
    def loaded(text: str) -> Robot:
        return _load(
            tmp_path, _robot(_FIRST, _joint("bc", "b", "c", "revolute", _LIMIT + f'<axis xyz="{text}"/>'), links="abc")
        )

    along = np.array([float(part) for part in axis.split()])
    unit, given = loaded(" ".join(map(repr, (along / np.linalg.norm(along)).tolist()))), loaded(axis)
    q = np.array([0.3, -0.4])
    symbol = ca.SX.sym("q", 2)
    symbolic = ca.Function("pose", [symbol], [given.symbolic(symbol).pose])
    np.testing.assert_allclose(given.pose(q), unit.pose(q), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(symbolic(q).full(), unit.pose(q), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(
    "inertial", ['<mass value="1e999"/>', '<mass value="nan"/>', '<origin xyz="0 0 1e300"/><mass value="1"/>']
)
def test_masses_that_are_no_numbers(tmp_path: Path, inertial: str) -> None:
    text = _robot(_FIRST, links="ab").replace('<mass value="1"/>', inertial)
    try:
        assert not _load(tmp_path, text).has_inertia
    except RobotError as error:
        assert re.match(r"joint 'ab': expected finite numbers for mass and inertia|.*pinocchio rejects", str(error))  # noqa: PT017


def _long(joints: int, kind: str) -> str:
    names = [f"l{i}" for i in range(joints + 1)]
    links = "".join(f'<link name="{name}"/>' for name in names)
    chain = [_joint(f"j{i}", names[i], names[i + 1], kind if i else "revolute") for i in range(joints)]
    return f'<robot name="long">{links}{"".join(chain)}</robot>'


@pytest.mark.parametrize("kind", ["fixed", "revolute"])
def test_a_very_long_chain_is_refused_at_once(tmp_path: Path, kind: str) -> None:
    with pytest.raises(RobotError, match=r"expected at most 1000 links, got 20001; "):
        _load(tmp_path, _long(20_000, kind))


def test_a_long_chain_is_an_arm_or_none(tmp_path: Path) -> None:
    assert _load(tmp_path, _long(999, "fixed")).nv == 1
    with pytest.raises(RobotError, match=r"expected at most 100 moving joints between base and tip, got 101; "):
        _load(tmp_path, _long(101, "revolute"))


def test_limits_off_the_chain_are_not_asked_for(tmp_path: Path) -> None:
    loose = _joint("bd", "b", "d", inside='<limit lower="0" upper="0" velocity="0" effort="0"/>')
    assert _load(tmp_path, _robot(_FIRST, _SECOND, loose), tip="c").nv == 2


def test_robot_without_masses_has_no_inertia(tmp_path: Path) -> None:
    robot = _load(tmp_path, _robot(_FIRST, links="ab").replace(_INERTIAL, ""))
    assert not robot.has_inertia
    with pytest.raises(RobotError, match=r"^mass_matrix: expected a robot with link inertias, got one without; "):
        robot.mass_matrix([0.0])
