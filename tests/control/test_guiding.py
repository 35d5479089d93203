"""The hand-guiding controller: admittance, modes, drift compensation, limits, stops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from kinqp.control import (
    GuidingController,
    GuidingPhase,
    GuidingSettings,
    make_guiding,
    make_step,
    simulate_guiding,
)
from kinqp.formulations import InputError, Mode
from kinqp.robots import load_robot
from kinqp.solvers import PluginError, Status
from tests.control.hands import Pull, constant, smooth

ROBOT = load_robot("lbr_med14")
START = np.deg2rad([-55.0, 65.0, 10.0, -90.0, -5.0, 30.0, 0.0])
DT = 1e-3


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


def guiding(modes=("fix-orientation",), formulation="joint-space", **options):
    """A controller of the LBR."""
    return make_guiding(ROBOT, formulation, list(modes), **options)


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

    @given(st.floats(1e-12, 1e-6))
    def test_without_friction_it_is_newtons_law(self, damping):
        settings = GuidingSettings(admittance_damping=[damping] * 6, force_dead_zone=0.0)
        found = speeds(CONTROLLER_OF(settings), [8.0, 0, 0, 0, 0, 0], 3)
        assert found[:, 0] == pytest.approx([0.002, 0.004, 0.006], rel=1e-8)

    def test_steady_speed(self):
        # (13 N - 1 N dead zone) / 60 N s/m
        assert speeds(guiding(), [0, 13.0, 0, 0, 0, 0], 2000)[-1] == pytest.approx([0.0, 0.2, 0.0], rel=1e-9)

    @given(st.floats(0.0, 0.999), st.floats(-np.pi, np.pi))
    def test_nothing_moves_within_the_dead_zone(self, size, angle):
        wrench = [size * np.cos(angle), size * np.sin(angle), 0.0, 0.0, 0.0, 0.0]
        assert not speeds(CONTROLLER_OF(GuidingSettings()), wrench, 2).any()

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


_CONTROLLERS: dict[str, GuidingController] = {}


def CONTROLLER_OF(settings):  # one for all examples of a property: making one lowers a formulation
    """A controller at rest with these settings."""
    if "one" not in _CONTROLLERS:
        _CONTROLLERS["one"] = guiding()
    controller = _CONTROLLERS["one"]
    controller.reset()
    controller.set(
        admittance_damping=settings.admittance_damping,
        force_dead_zone=settings.force_dead_zone,
    )
    return controller


class TestModes:
    def test_engaged_and_left_without_a_jump(self):
        controller = guiding(["fix-orientation", "line:z", "fix-position"])
        run = simulate_guiding(
            controller,
            smooth(0.0, 13.0, 5.0, 1.0, 0.0, 0.5),
            START,
            3.0,
            schedule=[(1.0, lambda c: c.engage("line:z")), (2.0, lambda c: c.engage("fix-position"))],
        )
        modes = list(dict.fromkeys(str(mode) for mode in run.mode))
        assert modes == ["fix-orientation", "line:z", "fix-position"]
        # The hand never lets go. What it pulls on a mass at rest is the largest change of velocity there is:
        # 3.4 m/s^2 and 14 rad/s^2; a jump of 0.2 m/s in a tick would be 200 m/s^2.
        change = np.diff(run.twist, axis=0) / DT
        assert np.abs(change[:, :3]).max() < 4.0
        assert np.abs(change[:, 3:]).max() < 15.0
        # The switch itself happens at rest.
        for tick in np.flatnonzero([a is not b for a, b in zip(run.mode[1:], run.mode[:-1], strict=True)]):
            assert not run.qd[tick].any()
        assert set(run.status) == {Status.SOLVED}

    def test_locked_rows_do_not_move_in_any_mode(self):
        controller = guiding(["fix-orientation", "line:z", "fix-position"])
        run = simulate_guiding(
            controller,
            smooth(0.0, 13.0, 5.0, 1.0, 0.0, 0.5),
            START,
            3.0,
            schedule=[(1.0, lambda c: c.engage("line:z")), (2.0, lambda c: c.engage("fix-position"))],
        )
        for tick in range(0, len(run.t), 50):
            locked = list(run.mode[tick].fixed_rows)
            # Drift compensation alone moves them, by less than 0.1 mm/s here.
            assert np.abs(run.v_actual[tick, locked]).max() < 1e-4

    def test_the_same_mode_again_is_anchored_anew(self):
        controller = guiding(["position", "fix-orientation"])
        run = simulate_guiding(controller, smooth(0, 10.0, 0, 0, 0, 0), START, 1.0)
        assert run.drift.max() == 0.0  # nothing is locked
        controller.engage("fix-orientation")
        q = run.q_end
        for _ in range(400):
            q = q + DT * controller(q, np.zeros(6)).qd
        assert str(controller.mode) == "fix-orientation"
        assert controller(q, np.zeros(6)).drift == pytest.approx([0.0, 0.0], abs=1e-9)

    def test_no_such_mode(self):
        with pytest.raises(ValueError, match="mode: expected one of fix-orientation, got 'line:z'"):
            guiding().engage("line:z")

    def test_a_formulation_that_brakes_comes_to_rest_too(self):
        controller = guiding(["fix-orientation", "line:z"], "joint-space-robust")
        run = simulate_guiding(
            controller, smooth(0, 10, 0, 0, 0, 0), START, 1.6, schedule=[(0.8, lambda c: c.engage("line:z"))]
        )
        assert str(run.mode[-1]) == "line:z"
        assert np.abs(run.acceleration()).max() < 10.0 * (1 + 1e-6)


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

    @given(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), st.floats(0.0, 3.1))
    def test_rotation_vector_agrees_with_scipy(self, axis, angle):
        import casadi as ca

        from kinqp.control.drift import rotation_vector

        length = np.linalg.norm(axis)
        vector = np.array(axis) / length * angle if length > 1e-3 else np.zeros(3)
        matrix = Rotation.from_rotvec(vector).as_matrix()
        found = np.array(ca.DM(ca.evalf(rotation_vector(ca.SX(matrix))))).ravel()
        assert found == pytest.approx(vector, abs=1e-7)


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


class TestTheHandNeverWorksAgainstAnUnexpectedMotion:
    @given(st.lists(st.floats(-60.0, 60.0), min_size=3, max_size=3), st.integers(0, 2**32 - 1))
    def test_commanded_and_actual_velocity_agree_in_direction(self, force, seed):
        controller = CONTROLLER_OF(GuidingSettings())
        rng = np.random.default_rng(seed)
        q = ROBOT.q_min + rng.random(7) * (ROBOT.q_max - ROBOT.q_min)
        at_limit = rng.random(7) < 0.3
        q = np.where(at_limit, np.where(rng.random(7) < 0.5, ROBOT.q_min, ROBOT.q_max), q)
        result = controller(q, [*force, 0, 0, 0])
        assert result.v @ result.v_actual >= -1e-12


class TestBadInput:
    @pytest.mark.parametrize(
        ("q", "wrench", "message"),
        [
            (START[:6], np.zeros(6), r"q: expected shape \(7,\), got \(6,\)"),
            (START, np.zeros(3), r"wrench: expected shape \(6,\), got \(3,\)"),
            (START, [0, np.nan, 0, 0, 0, 0], "wrench: expected finite numbers"),
            (START, "pull", "wrench: expected 6 numbers, got 'pull'"),
        ],
    )
    def test_call(self, q, wrench, message):
        with pytest.raises(InputError, match=message):
            guiding()(q, wrench)

    @pytest.mark.parametrize(
        ("inputs", "message"),
        [
            ({"speed": 1.0}, "speed: expected an input among"),
            ({"qd_max": -1.0}, "qd_max: expected numbers above 0"),
            ({"admittance_mass": [1.0, 2.0]}, r"admittance_mass: expected shape \(6,\)"),
            ({"q_min": 9.0}, "q_min and q_max: expected q_min <= q_max"),
        ],
    )
    def test_set_changes_nothing(self, inputs, message):
        controller = guiding()
        with pytest.raises(InputError, match=message):
            controller.set(force_dead_zone=0.0, **inputs)
        assert not controller(START, [0.9, 0, 0, 0, 0, 0]).v.any()

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"admittance_mass": [1, 2]}, "admittance_mass: expected 6 positive numbers"),
            ({"admittance_damping": [0] * 6}, "admittance_damping: expected 6 positive numbers"),
            ({"drift_gain": -1}, "drift_gain: expected a number that is not negative"),
            ({"stop_deceleration": 0}, "stop_deceleration: expected a positive number"),
            ({"max_failures": 0}, "max_failures: expected a count of at least 1"),
        ],
    )
    def test_settings(self, settings, message):
        with pytest.raises(ValueError, match=message):
            GuidingSettings(**settings)

    def test_making(self):
        with pytest.raises(PluginError, match="baseline task-priority: expected compiled=False"):
            guiding(formulation="task-priority", compiled=True)
        with pytest.raises(ValueError, match="modes: expected at least one, each once, got free, free"):
            guiding(["free", "free"])
        with pytest.raises(ValueError, match="dt: expected a positive number of seconds"):
            guiding(dt=0.0)
        with pytest.raises(ValueError, match="duration: expected at least two periods"):
            simulate_guiding(guiding(), constant(0, 0, 0, 0, 0, 0), START, 1e-3)


def test_compiled_and_interpreted_agree():
    hand = smooth(4.0, 13.0, -6.0, 0.5, 0.2, -0.3)
    runs = [
        simulate_guiding(
            guiding(["fix-orientation", "fix-position"], compiled=compiled),
            hand,
            START,
            1.5,
            schedule=[(0.8, lambda c: c.engage("fix-position"))],
        )
        for compiled in (False, True)
    ]
    assert runs[0].q == pytest.approx(runs[1].q, abs=1e-10)
    assert runs[0].mode == runs[1].mode


@pytest.mark.parametrize("formulation", ["task-priority", "saturation-null-space", "hierarchical", "damped"])
def test_any_controller_can_be_guided(formulation):
    run = simulate_guiding(guiding(formulation=formulation), smooth(0, 13.0, 0, 0, 0, 0), START, 1.0)
    assert run.twist[-1, 1] == pytest.approx(0.2, rel=0.05)
    assert run.power().min() >= -1e-9
