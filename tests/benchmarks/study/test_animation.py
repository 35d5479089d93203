"""The animation's frames are the runs, and lose nothing that lasts for one tick only."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import pytest

from kinqp.benchmarks.study.animation import RATE, animation
from kinqp.benchmarks.study.skeleton import Skeleton
from kinqp.robots import load_robot

if TYPE_CHECKING:
    from kinqp.benchmarks.study import StudyResult
    from kinqp.benchmarks.study.write import Written


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "davinci5"])
def test_the_skeleton_runs_from_base_to_tool_through_the_joints(name: str) -> None:
    robot = load_robot(name)
    skeleton, rng = Skeleton(robot), np.random.default_rng(1)
    data = robot.model.createData()
    for _ in range(5):
        q = robot.random_configuration(rng)
        corners = skeleton(q)
        assert corners.shape == (skeleton.corners, 3)
        assert not corners[0].any()
        np.testing.assert_allclose(corners[-1], robot.pose(q)[:3, 3], atol=1e-9)
        pin.forwardKinematics(robot.model, data, robot.to_pinocchio(q))
        for joint in range(robot.nv):
            np.testing.assert_allclose(corners[skeleton.corner(joint)], data.oMi[joint + 1].translation, atol=2e-6)


def test_links_keep_their_lengths() -> None:
    robot = load_robot("lbr_med14")
    skeleton, rng = Skeleton(robot), np.random.default_rng(2)
    lengths = [np.linalg.norm(np.diff(skeleton(robot.random_configuration(rng)), axis=0), axis=1) for _ in range(5)]
    np.testing.assert_allclose(lengths, np.tile(lengths[0], (5, 1)), atol=1e-9)
    assert min(lengths[0]) > 1e-3
    # From the table to the flange when stretched out.
    assert sum(lengths[0]) == pytest.approx(0.36 + 0.42 + 0.40 + 0.126)


def test_frames_are_the_runs(study: StudyResult, written: Written) -> None:
    found = written.findings
    made = json.loads(json.dumps(animation(study, found.path, found.still), allow_nan=False))
    assert made["rate"] == RATE
    assert [run["letter"] for run in made["runs"]] == ["A", "B", "C"]
    assert made["limits"] == [-120.0, 120.0]
    for frames in made["runs"]:
        run, letter = study.runs[frames["letter"]], frames["letter"]
        count = len(frames["points"])
        assert count == 1 + int(np.ceil(run.t[-1] * RATE))
        assert {len(frames[key]) for key in ("force", "speed", "angle", "peak", "limit", "still")} == {count}
        for number in (0, count // 2, count - 1):
            tick = min(round(number / RATE / run.dt), len(run.t) - 1)
            np.testing.assert_allclose(frames["points"][number][-1], 1e3 * run.position[tick], atol=0.1)
            assert frames["angle"][number] == pytest.approx(np.rad2deg(run.q[tick, 3]), abs=0.01)
        # A peak of a single tick is in some frame.
        assert max(frames["peak"]) == pytest.approx(np.abs(run.acceleration()[:, 3]).max(), abs=0.01)
        assert any(frames["limit"])
        held = sum(frames["still"]) / RATE
        assert held == pytest.approx(np.count_nonzero(found.still[letter]) * run.dt, abs=0.2)


def test_the_path_that_is_shown_is_the_one_that_was_followed(written: Written) -> None:
    path = written.findings.path
    settings = written.findings.study.settings
    np.testing.assert_allclose(path[0], written.findings.study.runs["A"].position[0], atol=1e-9)
    middle = 0.5 * (path[0] + path[-1])
    np.testing.assert_allclose(np.linalg.norm(path - middle, axis=1), settings.radius)
