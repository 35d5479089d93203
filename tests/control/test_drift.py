"""Drift compensation: the pose that a mode was engaged at is kept, or come back to."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kinqp.control import GuidingSettings, simulate_guiding
from kinqp.solvers import Status
from tests.control.guided import DT, ROBOT, START, guiding, quick
from tests.control.hands import Pull


class TestDrift:
    def test_without_compensation_the_pose_drifts_and_with_it_it_does_not(self):
        def pull(t, *_):
            return [12.0 * np.sin(2.0 * t), 12.0 * np.cos(2.0 * t), 0, 0, 0, 0]

        drifts = {}
        for gain in (0.0, 10.0):
            controller = guiding(compiled=True, settings=GuidingSettings(drift_gain=gain, drift_turn_dead_zone=0.0))
            drifts[gain] = simulate_guiding(controller, Pull(pull), START, 6.0).drift[:, 1]
        assert drifts[0.0][-1] > 3.0 * drifts[10.0].max()
        # Settled where gain times error balances the rate of drift.
        rate = np.abs(np.diff(drifts[0.0])).max() / DT
        assert drifts[10.0].max() < 2.0 * rate / 10.0

    def test_a_pose_that_is_off_is_taken_back_at_the_rate_set(self):
        controller = guiding(["line:z"], settings=GuidingSettings(drift_speed=0.004, drift_dead_zone=0.0))
        controller(START, np.zeros(6))
        # Off sideways by 2 mm, by a least-squares joint motion.
        pose = ROBOT.pose(START)
        sideways = pose[:3, :3] @ [1.0, 0.0, 0.0]
        q = START + np.linalg.pinv(ROBOT.jacobian(START)) @ [*(0.002 * sideways), 0, 0, 0]
        first = controller(q, np.zeros(6))
        speed = (ROBOT.jacobian(q) @ first.qd)[:3] @ sideways
        assert speed == pytest.approx(-0.004, rel=1e-3)
        for _ in range(3000):
            q = q + DT * controller(q, np.zeros(6)).qd
        assert controller(q, np.zeros(6)).drift == pytest.approx([0.0, 0.0], abs=2e-5)

    def test_the_dead_zone_leaves_small_errors_alone(self):
        controller = guiding(["line:z"], settings=GuidingSettings(drift_dead_zone=1e-3))
        controller(START, np.zeros(6))
        sideways = ROBOT.pose(START)[:3, :3] @ [1.0, 0.0, 0.0]
        q = START + np.linalg.pinv(ROBOT.jacobian(START)) @ [*(0.9e-3 * sideways), 0, 0, 0]
        result = controller(q, np.zeros(6))
        assert result.drift[0] == pytest.approx(0.9e-3, rel=1e-2)
        assert np.abs(ROBOT.jacobian(q) @ result.qd)[:3].max() < 1e-9

    def test_gives_way_where_limits_do_not_let_it(self):
        # All joints at standstill limits: nothing can be corrected, and the arm stays as it is without failing.
        controller = guiding(["fix-orientation"])
        controller(START, np.zeros(6))
        q = START + np.array([0, 0, 0, 0, 0, 0, 0.02])
        assert controller(q, np.zeros(6)).qd.any()
        controller.set(q_min=q, q_max=q)
        result = controller(q, np.zeros(6))
        assert result.status is Status.SOLVED
        assert result.yielded
        assert not result.qd.any()

    @quick
    @given(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), st.floats(0.0, 3.1))
    def test_rotation_vector_agrees_with_scipy(self, axis, angle):
        import casadi as ca

        from kinqp.control.drift import rotation_vector

        length = np.linalg.norm(axis)
        vector = np.array(axis) / length * angle if length > 1e-3 else np.zeros(3)
        matrix = Rotation.from_rotvec(vector).as_matrix()
        found = np.array(ca.DM(ca.evalf(rotation_vector(ca.SX(matrix))))).ravel()
        assert found == pytest.approx(vector, abs=1e-7)
