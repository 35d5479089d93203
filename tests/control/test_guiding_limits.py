"""Limits and stops of the hand-guiding controller, set and asked for while it runs."""

from __future__ import annotations

import numpy as np
import pytest

from kinqp.control import GuidingController, GuidingPhase, GuidingSettings, make_step, simulate_guiding
from kinqp.formulations import InputError, Mode
from kinqp.solvers import Status
from tests.control.guided import DT, ROBOT, START, guiding
from tests.control.hands import smooth


def elbow_angle(q):
    """Arm angle of the LBR by its joint centres [rad]; second opinion to the symbolic one."""
    import pinocchio as pin

    model, data = ROBOT.model, ROBOT.model.createData()
    pin.forwardKinematics(model, data, ROBOT.to_pinocchio(q))
    shoulder, elbow, wrist = (data.oMi[joint].translation for joint in (2, 4, 6))
    line = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    up = np.array([0.0, 0.0, 1.0]) - line[2] * line
    out = (elbow - shoulder) - line * (line @ (elbow - shoulder))
    return np.arctan2(line @ np.cross(up, out), up @ out)


class TestLimits:
    @pytest.mark.parametrize("formulation", ["joint-space", "cartesian-error"])
    def test_velocity_limits_on_the_fly_without_a_stop_or_a_jump(self, formulation):
        controller = guiding(formulation=formulation)
        tight = np.full(7, 0.05)
        run = simulate_guiding(
            controller,
            smooth(0, 13.0, 0, 0, 0, 0),
            START,
            2.5,
            schedule=[(1.0, lambda c: c.set(qd_max=tight)), (1.7, lambda c: c.set(qd_max=ROBOT.qd_max))],
        )
        before, within = run.qd[990], run.qd[1200:1690]
        assert np.abs(before).max() > 0.1  # so that the new limit bites
        assert np.abs(within).max() <= 0.05 + 1e-8
        assert np.abs(np.diff(run.qd, axis=0)[900:]).max() / DT <= 10.0 * (1 + 1e-6)
        assert np.linalg.norm(run.twist[1400, :3]) > 0.01  # slower, not stopped
        assert np.linalg.norm(run.twist[-1, :3]) > 0.15
        assert set(run.phase) == {GuidingPhase.GUIDING}

    def test_a_mode_has_settings_of_its_own(self):
        controller = guiding(["fix-orientation", "line:z"])
        slow = np.full(6, 600.0)
        controller.set("line:z", admittance_damping=slow, task_weight=2.0)
        pull = [5.0, 0, 0, 0, 0, 0]
        along = ROBOT.pose(START)[0, 2] * 5.0
        first = controller(START, pull).v[0]
        assert first == pytest.approx(4.0 / 60.0 * (1.0 - np.exp(-60.0 / 4.0 * DT)))
        controller = guiding(["line:z", "fix-orientation"], settings=GuidingSettings(force_dead_zone=0.0))
        controller.set(Mode.line("z"), admittance_damping=slow)
        assert controller(START, pull).v[0] == pytest.approx(along / 600.0 * (1.0 - np.exp(-600.0 / 4.0 * DT)))

    def test_rows_have_another_weight_in_each_mode(self):
        controller = guiding(["free", "fix-orientation"])
        controller.set("free", task_weight=[1.0, 1.0, 1.0, 0.02, 0.02, 0.02])
        with pytest.raises(InputError, match=r"task_weight: expected shape \(3,\)"):
            controller.set("fix-orientation", task_weight=[1.0, 1.0, 1.0, 0.02, 0.02, 0.02])
        with pytest.raises(InputError, match="qd_max: expected for all modes at once, got mode free"):
            controller.set("free", qd_max=0.1)
        with pytest.raises(ValueError, match="mode: expected one of free, fix-orientation, got 'position'"):
            controller.set("position", force_dead_zone=0.0)

    def test_joint_limit_is_slid_along(self):
        limits = ROBOT.q_max.copy()
        limits[3] = START[3] + 0.02
        controller = guiding(["fix-orientation"])
        controller.set(q_max=limits)
        run = simulate_guiding(controller, smooth(5.0, 12.0, 8.0, 0, 0, 0), START, 1.5)
        assert (run.q <= limits + 1e-9).all()
        assert np.linalg.norm(run.twist[-1, :3]) > 0.05

    def test_elbow_restriction_is_a_constraint_that_can_be_set(self):
        # A torque about the tool's z turns the arm about its shoulder and wrist: the elbow goes along, unless held.
        turned = {}
        for formulation in ("joint-space", "joint-space + elbow-range"):
            controller = guiding(["free"], formulation)
            if "elbow" in formulation:
                controller.set(elbow_range_width=1e-3, elbow_range_angle=elbow_angle(START))
            run = simulate_guiding(controller, smooth(0, 13.0, 5.0, 0, 0, 1.0), START, 1.0)
            turned[formulation] = abs(elbow_angle(run.q_end) - elbow_angle(START))
        assert turned["joint-space"] > 0.02
        assert turned["joint-space + elbow-range"] < 2e-3


class TestStops:
    def test_stop_and_resume(self):
        controller = guiding()
        run = simulate_guiding(
            controller,
            smooth(0, 13.0, 0, 0, 0, 0),
            START,
            2.0,
            schedule=[(0.8, lambda c: c.stop("the surgeon let go")), (1.4, lambda c: c.resume())],
        )
        assert run.phase[1300] is GuidingPhase.STOPPED
        assert not run.qd[1200:1400].any()
        assert np.linalg.norm(run.twist[-1, :3]) > 0.15
        assert np.abs(np.diff(run.twist[:, :3], axis=0)).max() / DT < 4.0
        assert controller.reason == ""

    def test_ticks_that_fail_end_in_a_stop(self):
        class Broken:
            """A step whose solver gives up from the tenth tick on."""

            def __init__(self):
                self._inner, self._calls = make_step(ROBOT, "joint-space", "fix-orientation"), 0
                self.robot, self.mode, self.specs, self.inputs = (
                    self._inner.robot,
                    self._inner.mode,
                    self._inner.specs,
                    self._inner.inputs,
                )

            def __call__(self, q, v, **inputs):
                """Fail, later."""
                from dataclasses import replace

                self._calls += 1
                result = self._inner(q, v, **inputs)
                if self._calls <= 10:
                    return result
                return replace(result, qd=np.zeros(7), eps=-np.asarray(v), status=Status.MAX_ITERATIONS, active=())

        controller = GuidingController([Broken()], GuidingSettings(max_failures=3))
        results = [controller(START, [0, 13.0, 0, 0, 0, 0]) for _ in range(20)]
        assert [result.status for result in results[9:12]] == [
            Status.SOLVED,
            Status.MAX_ITERATIONS,
            Status.MAX_ITERATIONS,
        ]
        assert controller.phase is GuidingPhase.STOPPED
        assert "3 ticks in a row" in controller.reason
        assert not results[-1].qd.any()

    def test_self_motion_is_stopped_within_the_acceleration_limits(self):
        # Gradient projection goes on moving the elbow when the hand asks for nothing.
        controller = guiding(formulation="gradient-projection")
        q, commands = START.copy(), []
        for tick in range(600):
            if tick == 300:
                controller.stop()
            commands.append(controller(q, np.zeros(6)).qd)
            q = q + DT * commands[-1]
        assert np.abs(commands[299]).max() > 0.01
        assert not commands[-1].any()
        assert np.abs(np.diff(commands[299:], axis=0)).max() / DT <= 10.0 * (1 + 1e-9)
