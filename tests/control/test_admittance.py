"""The admittance: from what the hand pulls to how fast the tool is to go."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from kinqp.control import GuidingSettings
from kinqp.formulations import Mode
from tests.control.guided import DT, ROBOT, START, controller_with, guiding, quick


def speeds(controller, wrench, ticks):
    """What the admittance asks for, tick by tick, with the arm kept where it is."""
    return np.array([controller(START, wrench).v for _ in range(ticks)])


class TestAdmittance:
    def test_exact_solution(self):
        # Second opinion: the matrix exponential of (v, F) under M dv/dt + B v = F, F constant.
        mass, damping = np.array([3.0, 5.0, 7.0]), np.array([20.0, 60.0, 200.0])
        settings = GuidingSettings(
            admittance_mass=[*mass, 1, 1, 1], admittance_damping=[*damping, 1, 1, 1], force_dead_zone=0.0
        )
        force = np.array([4.0, -2.0, 9.0])
        found = speeds(guiding(settings=settings), [*force, 0, 0, 0], 50)
        for row in range(3):
            system = np.array([[-damping[row] / mass[row], force[row] / mass[row]], [0.0, 0.0]])
            expected = [(expm(system * DT * (k + 1)) @ [0.0, 1.0])[0] for k in range(50)]
            assert found[:, row] == pytest.approx(expected, rel=1e-12)

    @quick
    @given(st.floats(1e-12, 1e-6))
    def test_without_friction_it_is_newtons_law(self, damping):
        settings = GuidingSettings(admittance_damping=[damping] * 6, force_dead_zone=0.0)
        found = speeds(controller_with(settings), [8.0, 0, 0, 0, 0, 0], 3)
        assert found[:, 0] == pytest.approx([0.002, 0.004, 0.006], rel=1e-8)

    def test_steady_speed(self):
        # (13 N - 1 N dead zone) / 60 N s/m
        assert speeds(guiding(), [0, 13.0, 0, 0, 0, 0], 2000)[-1] == pytest.approx([0.0, 0.2, 0.0], rel=1e-9)

    @quick
    @given(st.floats(0.0, 0.999), st.floats(-np.pi, np.pi))
    def test_nothing_moves_within_the_dead_zone(self, size, angle):
        wrench = [size * np.cos(angle), size * np.sin(angle), 0.0, 0.0, 0.0, 0.0]
        assert not speeds(controller_with(GuidingSettings()), wrench, 2).any()

    def test_no_step_at_the_dead_zones_edge(self):
        controller = guiding()
        at_edge = [
            speeds(controller, [1.0 + e, 0, 0, 0, 0, 0], 1)[0, 0] for e in (1e-9, 1e-6, 1e-3) if not controller.reset()
        ]
        assert at_edge == pytest.approx(np.array([1e-9, 1e-6, 1e-3]) * DT / 4.0, rel=1e-2)

    def test_the_dead_zone_is_that_of_guided_rows(self):
        # A push sideways does not help a pull along the line out of its dead zone.
        controller = guiding(["line:z@world"])
        assert not speeds(controller, [50.0, 50.0, 0.9, 9.0, 9.0, 9.0], 5).any()

    def test_torque_counts_about_the_pivot(self):
        # A force sideways at the tip turns the tool about a pivot 0.1 m ahead of it, with that lever arm.
        controller = guiding(["rcm:0.1"], settings=GuidingSettings(torque_dead_zone=0.0, force_dead_zone=0.0))
        rotation = ROBOT.pose(START)[:3, :3]
        force = rotation @ [1.0, 0.0, 0.0]
        v = controller(START, [*force, 0.0, 0.0, 0.0]).v
        # v = (insertion, rotations); the arm from pivot to tip is -0.1 z, and -0.1 z x 1 x = -0.1 y.
        decay = 1.0 - np.exp(-1.2 / 0.08 * DT)
        assert v == pytest.approx([0.0, 0.0, -0.1 * decay / 1.2, 0.0], abs=1e-15)

    @quick
    @given(st.lists(st.floats(-40.0, 40.0), min_size=6, max_size=6), st.floats(0.0, 0.3))
    def test_the_modes_wrench_does_the_same_work(self, wrench, depth):
        mode = Mode.rcm(depth)
        pose = ROBOT.pose(START)
        twist_map = mode.twist_map_at(pose)
        along = np.linalg.solve(twist_map.T, wrench)  # what `wrench_along` stands for
        import casadi as ca

        from kinqp.control.admittance import wrench_along

        found = np.array(ca.DM(ca.evalf(wrench_along(mode, ca.SX(pose), ca.SX(wrench))))).ravel()
        assert found == pytest.approx(along, abs=1e-10)
