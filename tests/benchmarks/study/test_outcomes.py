from dataclasses import replace

import numpy as np
import pytest

from kinqp.benchmarks.study.outcomes import joint_torques, outcomes_of, path_error, stops_of
from kinqp.control import GuidedRun, GuidingPhase, SemicirclePath
from kinqp.formulations import Mode
from kinqp.robots import load_robot
from kinqp.solvers import Status

ROBOT = load_robot("lbr_med14")
DT = 1e-3
PATH = SemicirclePath(np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), 0.30)


def resting(count: int) -> GuidedRun:
    """The arm at rest for so many ticks, nobody touching it."""
    q = np.deg2rad([0.0, 40.0, 0.0, -90.0, 0.0, 50.0, 0.0])
    six = np.zeros((count, 6))
    return GuidedRun(
        robot=ROBOT, dt=DT, t=np.arange(count) * DT, q=np.tile(q, (count, 1)), qd=np.zeros((count, 7)),
        position=np.zeros((count, 3)), rotation=np.tile(np.eye(3), (count, 1, 1)), wrench=six, twist=six.copy(),
        v=six.copy(), v_actual=six.copy(), status=(Status.SOLVED,) * count, mode=(Mode.fix_orientation(),) * count,
        phase=(GuidingPhase.GUIDING,) * count, active=((),) * count, iterations=np.zeros(count, dtype=np.int64),
        drift=np.zeros((count, 2)), yielded=np.zeros(count, dtype=bool), q_end=q,
    )  # fmt: skip


def columns(count: int, width: int, **entries) -> np.ndarray:
    array = np.zeros((count, width))
    for name, value in entries.items():
        array[:, int(name[1:])] = value
    return array


def test_a_stop_is_a_tool_that_stands_although_it_is_pulled():
    speed, force = np.full(1000, 0.1), np.full(1000, 10.0)
    speed[100:350] = 0.0  # a stop of 0.25 s
    speed[500:550] = 0.0  # too short
    speed[600:900], force[600:900] = 0.0, 2.0  # nobody pulls
    speed[950:] = 0.0  # too short, and at the end
    run = replace(resting(1000), twist=columns(1000, 6, c1=speed), wrench=columns(1000, 6, c2=force))
    assert stops_of(run) == (1, pytest.approx(0.25))
    assert stops_of(resting(1000)) == (0, 0.0)


def test_a_stop_that_lasts_to_the_end_counts():
    speed = np.concatenate([np.full(100, 0.1), np.zeros(100)])
    run = replace(resting(200), twist=columns(200, 6, c0=speed), wrench=columns(200, 6, c0=5.0))
    assert stops_of(run) == (1, pytest.approx(0.1))


def test_at_rest_the_torques_are_those_of_gravity():
    run = resting(3)
    np.testing.assert_allclose(joint_torques(run), np.tile(ROBOT.bias_forces(run.q[0], np.zeros(7)), (3, 1)))


def test_in_motion_the_torques_are_mass_times_acceleration_and_what_holds_it():
    rng = np.random.default_rng(1)
    run = replace(resting(5), q=rng.uniform(-1.0, 1.0, (5, 7)), qd=rng.uniform(-1.0, 1.0, (5, 7)))
    qdd = np.diff(run.qd, axis=0, prepend=0.0) / DT
    expected = [ROBOT.mass_matrix(q) @ a + ROBOT.bias_forces(q, v) for q, v, a in zip(run.q, run.qd, qdd, strict=True)]
    np.testing.assert_allclose(joint_torques(run), expected, rtol=1e-9, atol=1e-9)


def test_the_distance_from_a_semicircle_is_that_of_radii():
    angle = np.linspace(0.1, 3.0, 50)
    points = np.stack([np.full(50, 0.0), 0.3 - 0.31 * np.cos(angle), 0.31 * np.sin(angle)], axis=1)
    run = replace(resting(50), position=points)
    assert path_error(run, PATH) == pytest.approx(0.01, rel=1e-4)
    aside = replace(resting(50), position=points + np.array([0.02, 0.0, 0.0]))
    assert path_error(aside, PATH) == pytest.approx(np.hypot(0.01, 0.02), rel=1e-4)


def test_outcomes_of_a_run_made_by_hand():
    count = 1000
    qd = np.zeros((count, 7))
    qd[500:, 3] = 0.15  # the elbow, from rest in one period
    qd[700:, 2] = -0.2
    status = [Status.SOLVED] * count
    status[10] = Status.INACCURATE
    against = np.where(np.arange(count) < 500, -0.2, 0.3)
    run = replace(
        resting(count),
        qd=qd,
        twist=columns(count, 6, c0=against),
        wrench=columns(count, 6, c0=10.0),
        v=columns(count, 6, c0=0.1),
        v_actual=columns(count, 6, c0=np.where(np.arange(count) % 100 == 0, -0.1, 0.1)),
        drift=columns(count, 2, c0=np.linspace(0.0, 2e-4, count), c1=np.deg2rad(0.1)),
        status=tuple(status),
    )
    found = outcomes_of(run, PATH, 3, finished=True)
    assert found["finished"] is True
    assert found["time"] == pytest.approx(1.0)
    assert found["peak_qdd"] == pytest.approx(200.0)
    assert found["peak_qdd_joint"] == 2
    assert found["elbow_peak_qdd"] == pytest.approx(150.0)
    assert found["rms_qdd"] == pytest.approx(np.sqrt((200.0**2 + 150.0**2) / (7 * count)))
    assert found["work_against"] == pytest.approx(10.0 * 0.2 * 0.5)
    assert found["unexpected"] == 10
    assert found["unsolved"] == 1
    assert found["drift_mm"] == pytest.approx(0.2)
    assert found["drift_deg"] == pytest.approx(0.1)
    assert found["stops"] == 0
    torques = joint_torques(run)
    assert found["peak_torque"] == pytest.approx(np.abs(torques).max())
    assert found["peak_torque_rate"] == pytest.approx(np.abs(np.diff(torques, axis=0)).max() / DT)
    assert found["peak_torque"] > 1.2 * np.abs(torques[:400]).max()
