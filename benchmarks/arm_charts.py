"""Charts of an arm's workspace, of points in it and of motions along them, in millimetres and degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import contourpy
import numpy as np

from .charts import BLUE, GREEN, GREY, ORANGE, RED, Chart, Series

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..robots import Robot, Workspace
    from .arm_study import PathStudy
    from .charts import Style

    Array = NDArray[np.float64]

_XYZ: Final = ("x [mm]", "y [mm]", "z [mm]")
_COLOURS: Final = (ORANGE, GREEN, BLUE)
# How much of a motion the charts of velocity and acceleration show: more would be a solid block [s].
_WINDOW: Final = 2.0
_PLANES: Final = {"xy": (0, 1, 2), "xz": (0, 2, 1), "yz": (1, 2, 0)}


def workspace_sparse(workspace: Workspace, path: Array, *, count: int = 2_500) -> Chart:
    """Some even points of the reachable set, and the path, shape (N, 3) [m]."""
    chosen = np.random.default_rng(0).permutation(len(workspace.points))[:count]
    return Chart(
        "workspace-sparse",
        "Reachable set, sparse view",
        f"{min(count, len(workspace.points))} of {len(workspace.points)} evenly spaced points, and the path.",
        _XYZ,
        (_solid("reachable", workspace.points[chosen], "heights", BLUE), _solid("path", path, "line", RED)),
    )


def workspace_dense(workspace: Workspace, path: Array) -> Chart:
    """All even points, the boundary, and the path, shape (N, 3) [m]."""
    corners, triangles = workspace.boundary()
    x, y, z = 1e3 * corners.T
    return Chart(
        "workspace-dense",
        "Reachable set, dense view with its boundary",
        f"One point in every cube of {1e3 * workspace.spacing:g} mm that any of {workspace.samples} joint positions "
        f"reaches: {len(workspace.points)} points, {1e6 * workspace.volume:.0f} cm³.",
        _XYZ,
        (
            Series("boundary", x, y, "mesh", GREY, z, triangles),
            _solid("reachable", workspace.points, "heights", BLUE),
            _solid("path", path, "line", RED),
        ),
    )


def workspace_plane(workspace: Workspace, path: Array, plane: str) -> Chart:
    """Shadow of the reachable set on a plane (`xy`, `xz`, `yz`), filled, with its outline, the points and the path."""
    first, second, along = _PLANES[plane]
    x, y, covered = workspace.outline(along)
    lines = contourpy.contour_generator(1e3 * x, 1e3 * y, covered.T.astype(float)).lines(0.5)
    outline = [
        Series("outline" if i == 0 else "", np.array(line)[:, 0], np.array(line)[:, 1], "fill", BLUE)
        for i, line in enumerate(lines)
    ]
    chosen = np.random.default_rng(0).permutation(len(workspace.points))[:4_000]
    points = 1e3 * workspace.points[chosen]
    return Chart(
        f"workspace-{plane}",
        f"Reachable set, {plane} plane",
        "Shadow of the reachable set, points of it, and the path. The outline follows cubes of "
        f"{1e3 * workspace.spacing:g} mm.",
        (_XYZ[first], _XYZ[second]),
        (
            *outline,
            Series("reachable", points[:, first], points[:, second], "cloud", GREY),
            Series("path", 1e3 * path[:, first], 1e3 * path[:, second], "line", RED),
        ),
        equal=plane == "xy",
    )


def near_path(workspace: Workspace, path: Array, distance: float, plane: str) -> Chart:
    """Points of the reachable set within a distance of the path [m]: what a search of a cloud has to choose from."""
    gaps = np.min(np.linalg.norm(workspace.points[:, None, :] - path[None, ::2, :], axis=2), axis=1)
    close = 1e3 * workspace.points[gaps < distance]
    first, second, _ = _PLANES[plane]
    return Chart(
        f"near-path-{plane}",
        f"Reachable points within {1e3 * distance:g} mm of the path, {plane} plane",
        f"{len(close)} points. Where the path runs outside them, it is out of reach.",
        (_XYZ[first], _XYZ[second]),
        (
            Series("reachable", close[:, first], close[:, second], "points", BLUE),
            Series("path", 1e3 * path[:, first], 1e3 * path[:, second], "line", RED),
        ),
        equal=plane == "xy",
    )


def solid_path(path: Array) -> Chart:
    """The path by itself, shape (N, 3) [m]."""
    return Chart("path", "The path", "As asked for.", _XYZ, (_solid("path", path, "line", RED),))


def approximation(study: PathStudy, plane: str) -> Chart:
    """Targets and where the tool gets, in a plane."""
    first, second, _ = _PLANES[plane]
    given = study.solution
    target, there = 1e3 * given.targets, 1e3 * given.position
    miss = np.full((len(target), 3, 2), np.nan)
    miss[:, 0], miss[:, 1] = target[:, [first, second]], there[:, [first, second]]
    lines = miss[~study.reachable].reshape(-1, 2)
    return Chart(
        f"points-{study.count}-{plane}",
        f"{study.count} points of the path and where the tool gets, {plane} plane",
        f"{np.count_nonzero(study.reachable)} of {study.count} reached; mean error {1e3 * given.error.mean():.3f} mm, "
        f"largest {1e3 * given.error.max():.2f} mm. Lines join a target out of reach with the nearest reachable point.",
        (_XYZ[first], _XYZ[second]),
        (
            Series("target", target[:, first], target[:, second], "circles", RED),
            Series("tool", there[:, first], there[:, second], "points", BLUE),
            Series("out of reach by", lines[:, 0], lines[:, 1], "line", GREY),
        ),
        equal=plane == "xy",
    )


def errors(studies: tuple[PathStudy, ...]) -> Chart:
    """Distance from target along the path, ours and the second opinion's."""
    series = []
    for study, colour in zip(studies, (BLUE, GREEN), strict=False):
        share = np.linspace(0.0, 1.0, study.count)
        series.append(Series(f"{study.count} points", share, 1e3 * study.solution.error, "line", colour))
        second = 1e3 * study.second_opinion
        series.append(Series(f"{study.count} points, second opinion", share, second, "circles", colour))
    return Chart(
        "error",
        "Distance from the path that the position limits make unavoidable",
        "The QP's answer at every point, and, where it is not zero, the best of many starts of another method.",
        ("share of the path [-]", "distance [mm]"),
        tuple(series),
    )


def joint(robot: Robot, study: PathStudy, number: int) -> Chart:
    """One joint over time for every motion, with its limits."""
    unit, scale = _unit(robot, number)
    end = max(motion.joints.t[-1] for motion in study.motions)
    series = [
        Series(motion.name, motion.joints.t, scale * motion.joints.q[:, number], "line", colour)
        for motion, colour in zip(study.motions, _COLOURS, strict=True)
    ]
    for name, limit in (("limits", robot.q_min[number]), ("", robot.q_max[number])):
        series.append(Series(name, np.array([0.0, end]), np.full(2, scale * limit), "dash", RED))
    name = robot.joint_names[number]
    return Chart(
        f"joint-{number + 1}-{name}",
        f"{name} along the {study.count} points",
        "Three motions through the same joint positions.",
        ("time [s]", f"{name} [{unit}]"),
        tuple(series),
    )


def utilisation(robot: Robot, study: PathStudy, *, acceleration: bool) -> Chart:
    """Largest share of its limit that any joint uses, over time."""
    what = "acceleration" if acceleration else "velocity"
    series = []
    for motion, colour in zip(study.motions, _COLOURS, strict=True):
        rate = motion.joints.qdd / robot.qdd_max if acceleration else motion.joints.qd / robot.qd_max
        shown = motion.joints.t <= _WINDOW
        series.append(Series(motion.name, motion.joints.t[shown], np.max(np.abs(rate[shown]), axis=1), "line", colour))
    series.append(Series("limit", np.array([0.0, _WINDOW]), np.ones(2), "dash", RED))
    return Chart(
        f"{what}-use",
        f"Share of the joints' {what} limits in use",
        f"Of all joints, the one nearest to its limit; the first {_WINDOW:g} s.",
        ("time [s]", f"{what} over its limit [-]"),
        tuple(series),
    )


def tool_solid(study: PathStudy) -> Chart:
    """Where the motions take the tool."""
    series = [
        _solid(motion.name, motion.tool, "line", colour) for motion, colour in zip(study.motions, _COLOURS, strict=True)
    ]
    return Chart(
        "tool",
        f"The tool along the {study.count} points",
        "Between the points joints are interpolated, so that the tool leaves the chords a little.",
        _XYZ,
        (_solid("target", study.solution.targets, "circles", RED), *series),
    )


def tool_deviation(study: PathStudy, path: Array) -> Chart:
    """Distance of the moving tool from the path, shape (N, 3), over the share of each motion's time."""
    series = []
    for motion, colour in zip(study.motions, _COLOURS, strict=True):
        gaps = np.array([np.min(np.linalg.norm(path - point, axis=1)) for point in motion.tool])
        series.append(Series(motion.name, motion.joints.t / motion.joints.t[-1], 1e3 * gaps, "line", colour))
    return Chart(
        "tool-deviation",
        "Distance of the moving tool from the path",
        "Where the path is out of reach this is the unavoidable error; the rest is what interpolating joints costs.",
        ("share of the motion's time [-]", "distance [mm]"),
        tuple(series),
    )


def _solid(name: str, points: ArrayLike, style: Style, colour: str) -> Series:
    x, y, z = 1e3 * np.asarray(points, dtype=float).T
    return Series(name, x, y, style, colour, z)


def _unit(robot: Robot, number: int) -> tuple[str, float]:
    prismatic = robot.model.joints[number + 1].shortname().startswith("JointModelP")
    return ("mm", 1e3) if prismatic else ("°", float(np.rad2deg(1.0)))
