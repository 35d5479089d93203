"""The ready-made capsules: where they lie, and which pairs can meet."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

from kinqp.robots import Capsule, RobotError, capsule_model, load_robot

from .arms import example_urdf

NAMES = ("lbr_med14", "lbr_med7", "ur5e")


def test_capsules_lie_along_the_arm() -> None:
    """By hand: the LBR upright, joint centres at heights of 0.36, 0.78 and 1.18 m, the flange at 1.306 m."""
    robot = load_robot("lbr_med14")
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, np.zeros(7))
    ends = {
        c.name: [p if c.link == 0 else data.oMi[c.link].act(np.array(p)) for p in (c.start, c.end)]
        for c in capsule_model("lbr_med14").capsules
    }
    heights = {name: sorted(round(float(p[2]), 4) for p in points) for name, points in ends.items()}
    assert heights["base"] == [0.0, 0.125]
    assert heights["shoulder"] == [0.2535, 0.3415]  # 0.1575 above the floor, plus 0.096 and 0.184
    assert heights["upper arm"] == [0.372, 0.46]  # shoulder at 0.36, plus 0.012 and 0.1
    assert heights["elbow"] == [0.6485, 0.7545]  # 0.5645 plus 0.084 and 0.19
    assert heights["forearm"] == [0.803, 0.869]  # elbow at 0.78, plus 0.023 and 0.089
    assert heights["hand"] == [1.18, 1.276]  # wrist at 1.18, and 3 cm below the flange
    for points in ends.values():
        for point in points:
            assert np.hypot(point[0], point[1]) < 0.06


@pytest.mark.parametrize("name", NAMES)
def test_models_fit_their_robots(name: str) -> None:
    robot, model = load_robot(name), capsule_model(name)
    named = {capsule.name: capsule for capsule in model.capsules}
    assert len(named) == len(model.capsules)
    assert {capsule.link for capsule in model.capsules} <= set(range(robot.nv + 1))
    for first, second in model.pairs:
        assert named[second].link - named[first].link >= 2


def test_ur5e_hands_hang_where_the_dh_table_puts_them() -> None:
    """At q = 0 the arm lies along -x; the wrist centres are the DH table's: y = -0.1333, then -0.1333 - 0.0996."""
    robot = load_robot("ur5e")
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, np.zeros(6))
    centre = {c.name: data.oMi[c.link].act(np.array(c.start)) for c in capsule_model("ur5e").capsules if c.link}
    np.testing.assert_allclose(centre["upper arm"], [0.0, -0.138, 0.1625], atol=1e-12)
    np.testing.assert_allclose(centre["forearm"], [-0.425, -0.007, 0.1625], atol=1e-12)
    np.testing.assert_allclose(centre["wrist 1"], [-0.8172, -0.1333, 0.1625], atol=1e-12)
    np.testing.assert_allclose(centre["wrist 2"], [-0.8172, -0.1333, 0.1625 - 0.0997], atol=1e-12)
    np.testing.assert_allclose(centre["wrist 3"], [-0.8172, -0.1333 - 0.065, 0.1625 - 0.0997], atol=1e-12)


# Where the capsules of the UR5e lie on the UR5, in the frames of its own URDF: its lengths, its axes. The last one
# twice, since the UR5e's wrist 3 is longer by the difference of the two arms' d6.
LONGER = 0.0996 - 0.0823
ON_UR5 = (
    ("base", "base", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ("shoulder", "shoulder", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ("upper arm", "upperarm", (0.0, 0.0, 0.0), (0.0, 0.0, 0.425)),
    ("forearm", "forearm", (0.0, 0.0, 0.0), (0.0, 0.0, 0.39225)),
    ("wrist 1", "wrist1", (0.0, 0.093, 0.0), (0.0, 0.093, 0.0)),
    ("wrist 2", "wrist2", (0.0, 0.0, 0.09465), (0.0, 0.0, 0.09465)),
    ("wrist 3", "wrist3", (0.0, 0.065, 0.0), (0.0, 0.065 + LONGER, 0.0)),
    ("wrist 3", "wrist3", (0.0, 0.065 - LONGER, 0.0), (0.0, 0.065, 0.0)),
)


@pytest.mark.parametrize(("capsule", "mesh", "start", "end"), ON_UR5)
def test_ur5e_capsules_hold_the_meshes_of_its_predecessor(
    capsule: str, mesh: str, start: tuple[float, ...], end: tuple[float, ...]
) -> None:
    (own,) = (c for c in capsule_model("ur5e").capsules if c.name == capsule)
    path = example_urdf("ur5").parents[1] / "meshes/ur5/collision" / f"{mesh}.stl"
    vertices = np.array(coal.MeshLoader().load(str(path), np.ones(3)).vertices())
    assert len(vertices) > 50
    along = np.subtract(end, start)
    share = np.clip((vertices - start) @ along / max(along @ along, 1e-12), 0.0, 1.0)
    away = np.linalg.norm(vertices - start - share[:, None] * along, axis=1)
    assert np.max(away) <= own.radius
    # Nor is there much air in it.
    assert np.max(away) > own.radius - 0.006


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"link": -1}, "expected a link of 0"),
        ({"radius": 0.0}, "expected a positive radius, got 0.0"),
        ({"radius": float("nan")}, "expected a positive radius, got nan"),
        ({"start": (0.0, float("inf"), 0.0)}, "expected start as 3 finite numbers"),
        ({"end": (0.0, 0.0)}, "expected end as 3 finite numbers"),
    ],
)
def test_wrong_capsules_are_named(values: dict[str, object], message: str) -> None:
    good = {"name": "tool", "link": 6, "start": (0.0, 0.0, 0.0), "end": (0.0, 0.0, 0.1), "radius": 0.05}
    with pytest.raises(RobotError, match=f"^capsule 'tool': {message}"):
        Capsule(**(good | values))  # type: ignore[arg-type]  # that is the point


def test_an_arm_without_capsules_says_so() -> None:
    with pytest.raises(RobotError, match=r"expected one of lbr_med14, lbr_med7, ur5e, got 'davinci5'; give your own"):
        capsule_model("davinci5")
