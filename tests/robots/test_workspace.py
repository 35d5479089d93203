"""Reachable sets against areas and volumes known in closed form, and A_8^12 in letters against the arm."""

import numpy as np
import pytest
import sympy as sp

from kinqp.robots import DhRow, load_robot, robot_from_dh, sample_workspace, tool_positions
from kinqp.robots.davinci5 import DAVINCI5_ROWS
from kinqp.robots.dh_symbolic import dh_matrix


def cylinder(radius=0.5, height=0.4):
    """A solid cylinder: lift, turn, reach."""
    rows = (
        DhRow(name="lift", kind="prismatic", q_min=0.0, q_max=height, qd_max=1.0),
        DhRow(name="turn", kind="revolute", alpha=np.pi / 2, q_min=-np.pi, q_max=np.pi, qd_max=1.0),
        DhRow(name="reach", kind="prismatic", q_min=0.0, q_max=radius, qd_max=1.0),
    )
    return robot_from_dh("cylinder", rows)


@pytest.fixture(scope="module")
def sampled():
    return sample_workspace(cylinder(), 2**18, spacing=0.02)


def test_positions_are_the_robots() -> None:
    for name in ("davinci5", "lbr_med14", "ur5e"):
        robot = load_robot(name)
        Q = np.array([robot.random_configuration(np.random.default_rng(seed)) for seed in range(20)])
        expected = [robot.pose(q)[:3, 3] for q in Q]
        np.testing.assert_allclose(tool_positions(robot, Q), expected, rtol=0.0, atol=1e-14)


def test_volume_of_a_cylinder(sampled) -> None:
    """Cubes that are cut by the surface count whole: half a cube too much all around."""
    true = np.pi * 0.5**2 * 0.4
    surface = 2 * np.pi * 0.5**2 + 2 * np.pi * 0.5 * 0.4
    assert true < sampled.volume < true + 1.2 * surface * 0.02


def test_points_are_even_though_samples_are_not(sampled) -> None:
    """One in every cube; half of the samples lie within half the radius, a quarter of the points."""
    cubes = np.floor((sampled.points - sampled.corner) / sampled.spacing).astype(int)
    assert len(np.unique(cubes, axis=0)) == len(cubes) == np.count_nonzero(sampled.hit)
    radius = np.linalg.norm(sampled.points[:, :2], axis=1)
    assert np.mean(radius < 0.25) == pytest.approx(0.25, abs=0.02)
    for q, point in list(zip(sampled.q, sampled.points, strict=True))[::997]:
        np.testing.assert_allclose(cylinder().pose(q)[:3, 3], point, rtol=0.0, atol=1e-13)


def test_boundary_is_a_closed_surface_around_the_volume(sampled) -> None:
    corners, triangles = sampled.boundary()
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    # Every edge is run through as often one way as the other: no holes, one side outwards.
    forth, back = (np.ravel_multi_index(e.T, (len(corners),) * 2) for e in (edges, edges[:, ::-1]))
    np.testing.assert_array_equal(np.sort(forth), np.sort(back))
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    enclosed = np.sum(np.cross(a, b) * c) / 6.0
    assert enclosed == pytest.approx(np.count_nonzero(sampled.filled) * sampled.spacing**3, rel=1e-9)
    outer = sampled.points[sampled.on_boundary]
    depth = np.minimum.reduce([0.5 - np.linalg.norm(outer[:, :2], axis=1), outer[:, 2], 0.4 - outer[:, 2]])
    assert depth.max() < 2.0 * np.sqrt(3.0) * sampled.spacing


def test_outline_of_a_cylinder(sampled) -> None:
    x, y, covered = sampled.outline(2)
    assert covered.shape == (len(x), len(y))
    true = np.pi * 0.5**2
    assert true < covered.sum() * sampled.spacing**2 < true + 1.2 * 2 * np.pi * 0.5 * 0.02
    inside = np.hypot(*np.meshgrid(x, y, indexing="ij")) < 0.5
    assert covered[inside].all()


def test_inside_and_outside(sampled) -> None:
    points = [[0.0, 0.0, 0.2], [0.3, -0.3, 0.1], [0.55, 0.0, 0.2], [0.0, 0.0, -0.1], [9.0, 9.0, 9.0]]
    np.testing.assert_array_equal(sampled.contains(points), [True, True, False, False, False])


def test_same_seed_same_points() -> None:
    first, second = (sample_workspace(load_robot("ur5e"), 1000, spacing=0.1, seed=3) for _ in range(2))
    np.testing.assert_array_equal(first.points, second.points)
    assert first.samples == 1024


def test_bad_input(sampled) -> None:
    with pytest.raises(ValueError, match=r"^spacing: expected a positive length"):
        sample_workspace(cylinder(), 8, spacing=0.0)
    with pytest.raises(ValueError, match=r"^samples: expected at least 1"):
        sample_workspace(cylinder(), 0, spacing=0.1)
    with pytest.raises(ValueError, match=r"^Q: expected finite joint positions of shape \(N, 3\)"):
        tool_positions(cylinder(), np.zeros((4, 2)))
    with pytest.raises(ValueError, match=r"^axis: expected 0, 1 or 2"):
        sampled.outline(3)


def test_letters_are_the_arm() -> None:
    robot = load_robot("davinci5")
    matrix = dh_matrix(DAVINCI5_ROWS)
    numbers = sp.lambdify([sp.Symbol(row.name, real=True) for row in DAVINCI5_ROWS], matrix)
    for seed in range(10):
        q = robot.random_configuration(np.random.default_rng(seed))
        np.testing.assert_allclose(np.array(numbers(*q), dtype=float), robot.pose(q), rtol=0.0, atol=1e-14)
    assert not matrix.atoms(sp.Float)
    with pytest.raises(ValueError, match=r"^names: expected 5, got 1"):
        dh_matrix(DAVINCI5_ROWS, ["a"])
