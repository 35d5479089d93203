"""The hand-guiding controller in C: the same as the interpreted one, and on its own."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest

from kinqp.codegen import ExportError
from kinqp.control import CompiledGuiding, GuidingPhase, GuidingSettings, export_guiding, make_guiding, simulate_guiding
from kinqp.formulations import InputError
from kinqp.robots import load_robot
from kinqp.solvers import PluginError, Status
from tests.control.hands import Pull

ROBOT = load_robot("lbr_med14")
START = np.deg2rad([-55.0, 65.0, 10.0, -90.0, -5.0, 30.0, 0.0])
MODES = ("fix-orientation", "line:z")
STRICT = ("-std=c99", "-O0", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off")


# To and fro in all directions, into the elbow's limit as well.
SWING = Pull(lambda t, *_: np.array([8.0, 20.0, 12.0, 0.4, 0.3, 0.2]) * np.sin(2.0 * t + np.arange(6.0)))
SCHEDULE = [
    (0.4, lambda c: c.engage("line:z")),
    (0.9, lambda c: c.stop("look at the images")),
    (1.2, lambda c: c.resume()),
    (1.5, lambda c: c.engage("fix-orientation")),
    (1.9, lambda c: c.set(qd_max=np.full(7, 0.1), force_dead_zone=2.0)),
    (2.4, lambda c: c.engage("fix-orientation")),
]


@pytest.mark.parametrize(
    "formulation", ["joint-space", "cartesian-error", pytest.param("joint-space-robust", marks=pytest.mark.long)]
)
def test_the_same_session_as_the_interpreted_controller(formulation):
    narrow = ROBOT.q_max.copy()
    narrow[3] = START[3] + 0.03  # so that the elbow's limit is met
    runs = []
    for compiled in (False, True):
        controller = make_guiding(ROBOT, formulation, MODES, compiled=compiled)
        controller.set(q_max=narrow)
        runs.append(simulate_guiding(controller, SWING, START, 3.0, schedule=SCHEDULE))
    interpreted, compiled_run = runs
    assert compiled_run.q == pytest.approx(interpreted.q, abs=1e-9)
    for name in ("v", "v_actual", "drift"):
        assert getattr(compiled_run, name) == pytest.approx(getattr(interpreted, name), abs=1e-8), name
    for name in ("mode", "phase", "status"):
        assert getattr(compiled_run, name) == getattr(interpreted, name), name
    assert set(interpreted.phase) == set(GuidingPhase)
    assert any("[3] upper" in row for rows in compiled_run.active for row in rows)


def test_the_same_tick_the_same_bits():
    controller = make_guiding(ROBOT, "joint-space", MODES, compiled=True)
    runs = [simulate_guiding(controller, SWING, START, 0.5, schedule=SCHEDULE) for _ in range(2)]
    assert runs[0].qd.tobytes() == runs[1].qd.tobytes()


class TestFaults:
    def test_where_samples_are_lost_the_arm_brakes_and_stands_still(self):
        controller = CompiledGuiding(ROBOT, "joint-space", MODES, GuidingSettings(max_failures=3, hold_ticks=0))
        for _ in range(5):
            moving = controller(START, [0, 20.0, 0, 0, 0, 0])
        assert moving.qd.any()
        # Past the checks of the Python side: what a robot's own program may hand over.
        for place in (controller._q, controller._wrench):
            controller.reset()
            controller(START, [0, 20.0, 0, 0, 0, 0])
            place[0] = np.nan
            codes = [
                controller._tick(controller._parameters, controller._state, controller._input, controller._output)
                for _ in range(3)
            ]
            assert all(code != 0 for code in codes)
            assert (np.abs(list(controller._output.qd)) < 0.01).all(), "one tick of 20 N, less three of braking"
            assert not np.isnan(list(controller._output.v_actual)).any()
            assert controller.phase is GuidingPhase.STOPPING
            assert "3 ticks in a row were not solved" in controller.reason
        for _ in range(20):
            result = controller(START, [0, 20.0, 0, 0, 0, 0])
        assert result.phase is GuidingPhase.STOPPED
        controller.resume()
        results = [controller(START, [0, 20.0, 0, 0, 0, 0]) for _ in range(3)]
        assert results[-1].phase is GuidingPhase.GUIDING
        assert results[-1].qd.any()

    def test_a_mode_out_of_range_is_refused(self):
        controller = CompiledGuiding(ROBOT, "joint-space", MODES)
        controller._input.mode = 7
        assert controller(START, np.zeros(6)).status is Status.FAILED

    def test_capped_ticks_end_in_a_stop(self):
        controller = CompiledGuiding(ROBOT, "joint-space", MODES, GuidingSettings(max_failures=4))
        controller._parameters.step.max_iterations = 0
        controller.set(qd_max=1e-4)
        controller.reset()
        phases = [controller(START, [0, 30.0, 0, 0, 0, 0]).phase for _ in range(200)]
        assert phases[-1] is GuidingPhase.STOPPED
        assert "4 ticks" in controller.reason

    @pytest.mark.parametrize(
        ("inputs", "message"),
        [
            ({"speed": 1.0}, "speed: expected an input among"),
            ({"qd_max": -1.0}, "qd_max: expected numbers above 0"),
            ({"q_min": 9.0}, "q_min and q_max: expected q_min <= q_max"),
        ],
    )
    def test_bad_settings_change_nothing(self, inputs, message):
        controller = CompiledGuiding(ROBOT, "joint-space", MODES)
        with pytest.raises(InputError, match=message):
            controller.set(force_dead_zone=0.0, **inputs)
        assert not controller(START, [0.9, 0, 0, 0, 0, 0]).v.any()

    def test_names(self):
        with pytest.raises(PluginError, match="solver: expected active-set without options in C, got 'clarabel'"):
            make_guiding(ROBOT, "joint-space", MODES, "clarabel", compiled=True)
        with pytest.raises(ValueError, match="mode: expected one of fix-orientation, line:z, got 'free'"):
            CompiledGuiding(ROBOT, "joint-space", MODES).engage("free")


@pytest.mark.parametrize(
    ("robot", "formulation", "modes"),
    [
        ("lbr_med14", "joint-space", MODES),
        pytest.param("lbr_med14", "cartesian-error", ("rcm:0.1", "free"), marks=pytest.mark.long),
        pytest.param("lbr_med14", "joint-space-acceleration", MODES, marks=pytest.mark.long),
        pytest.param("ur5e", "joint-space-robust", ("plane:0,0,1",), marks=pytest.mark.long),
        # Its jerk limits add up, from tick to tick, by what a last acceleration is off.
        pytest.param("lbr_med14", "joint-space-robust", MODES, marks=pytest.mark.long),
        pytest.param("lbr_med14", "hierarchical", MODES, marks=pytest.mark.long),
    ],
)
def test_what_is_exported_builds_without_warnings_and_agrees(tmp_path, robot, formulation, modes):
    gcc = shutil.which("gcc")
    if gcc is None:
        pytest.skip("no gcc")
    folder = export_guiding(load_robot(robot), formulation, list(modes), tmp_path, name="arm")
    line = [gcc, *STRICT, "arm.c", "arm_guiding.c", "guiding_main.c", "-o", "check", "-lm"]
    subprocess.run(line, cwd=folder, check=True)
    done = subprocess.run(["./check"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert f"{300 * len(modes)} ticks, {len(modes)} modes engaged" in done.stdout
    # The check can fail: a state that remembers what was not sent.
    check = (folder / "guiding_main.c").read_text(encoding="utf-8")
    assert check.count("mode = output.mode;") == 1
    forgetful = check.replace("mode = output.mode;", "mode = output.mode;\n        state.qd[0] += 1e-12;")
    (folder / "forgetful.c").write_text(forgetful, encoding="utf-8")
    subprocess.run(
        [gcc, *STRICT, "arm.c", "arm_guiding.c", "forgetful.c", "-o", "check", "-lm"], cwd=folder, check=True
    )
    done = subprocess.run(["./check"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "remembered" in done.stdout
    # Another mass is another motion.
    recorded = (folder / "guiding_recorded.h").read_text(encoding="utf-8")
    line_of_wrench = next(text for text in recorded.splitlines() if "recorded_wrench" in text)
    (folder / "guiding_recorded.h").write_text(
        recorded.replace(line_of_wrench, line_of_wrench + "\n    {9.0, 9.0, 9.0, 9.0, 9.0, 9.0},").replace(
            "recorded_wrench[recorded_ticks]", "recorded_wrench[recorded_ticks + 1]"
        ),
        encoding="utf-8",
    )
    subprocess.run(line, cwd=folder, check=True)
    assert subprocess.run(["./check"], cwd=folder, capture_output=True, check=False).returncode == 1


def test_exporting_twice_gives_the_same_bytes(tmp_path):
    folders = [export_guiding(ROBOT, "cartesian-error", "fix-orientation", tmp_path / name) for name in "ab"]
    files = sorted(file.name for file in folders[0].iterdir())
    assert "kinqp_lbr_med14_cartesian_error_guiding.h" in files
    for file in files:
        assert (folders[0] / file).read_bytes() == (folders[1] / file).read_bytes()


def test_a_name_that_is_no_identifier(tmp_path):
    with pytest.raises(ExportError, match="name: expected a C identifier"):
        export_guiding(ROBOT, "joint-space", "free", tmp_path, name="9 lives")
