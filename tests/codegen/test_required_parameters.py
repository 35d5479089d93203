"""Exports of formulations with parameters that have no default: recorded with examples, refused while not set."""

import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from kinqp.codegen import ExportError, export_c
from kinqp.codegen.examples import example_inputs, stack_examples
from kinqp.control import export_guiding
from kinqp.formulations import JointSpace, Mode, get_formulation, lower
from kinqp.formulations.constraints import available_constraints
from kinqp.solvers.native import compiler
from tests.robots.arms import arm

STRICT = ("-std=c99", "-O0", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off")
WITHOUT_DEFAULT = ("remote-centre", "elbow-hold(correct=true)")


def run(folder: Path, main: str) -> subprocess.CompletedProcess[str]:
    sources = [main, *sorted(path.name for path in folder.glob("*.c") if not path.name.endswith("main.c"))]
    line = [*compiler(), *STRICT, *sources, "-o", "check", "-lm"]
    built = subprocess.run(line, cwd=folder, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr[:2000]
    return subprocess.run(["./check"], cwd=folder, capture_output=True, text=True, check=False)


# Most of a test's time goes into the compiler.
EVERY = [
    pytest.param(name, marks=() if name == "remote-centre" else pytest.mark.long)
    for name in (*WITHOUT_DEFAULT, *(name for name in available_constraints() if name not in WITHOUT_DEFAULT))
]


@pytest.mark.long
@pytest.mark.parametrize("constraint", [param.values[0] for param in EVERY])
def test_every_constraint_is_exported_and_checks_itself(constraint: str, tmp_path: Path) -> None:
    export_c(arm("lbr_med14"), f"joint-space + {constraint}", ["fix-orientation", "free"], tmp_path, name="one")
    done = run(tmp_path, "main.c")
    assert done.returncode == 0, done.stdout
    assert ": ok" in done.stdout


@pytest.mark.parametrize("constraint", EVERY)
def test_every_constraint_is_exported_with_a_controller(constraint: str, tmp_path: Path) -> None:
    export_guiding(arm("lbr_med14"), f"joint-space + {constraint}", "position", tmp_path, name="one")
    for main in ("main.c", "guiding_main.c"):
        done = run(tmp_path, main)
        assert done.returncode == 0, done.stdout
        assert ": ok" in done.stdout


def test_a_parameter_that_is_forgotten_is_refused_and_named(tmp_path: Path) -> None:
    export_c(arm("ur5e"), "joint-space + remote-centre", "line:z", tmp_path, name="rc")
    assert "`remote_centre_pivot[3]`" in (tmp_path / "README.md").read_text()
    assert "no default: must be set [m] */" in (tmp_path / "rc.h").read_text()
    main = (tmp_path / "main.c").read_text()
    line = next(line for line in main.splitlines() if "recorded_parameter_remote_centre_pivot" in line)
    main = main.replace(line, "(void)recorded_parameter_remote_centre_pivot;")
    main = main.replace('status %d\\n", tick, (int)output.status', 'parameter %d\\n", tick, output.parameter')
    (tmp_path / "main.c").write_text(main)
    number = (tmp_path / "rc.h").read_text().partition("RC_PARAMETER_REMOTE_CENTRE_PIVOT = ")[2].partition(",")[0]
    done = run(tmp_path, "main.c")
    assert done.returncode == 1
    assert f"tick 0: parameter {number}\n" in done.stdout


@dataclass(frozen=True)
class Guessed(JointSpace):
    """A formulation of one's own with parameters that have no default."""

    name: ClassVar[str] = "guessed"
    has_example: bool = False
    value: float = 2.0

    def declare(self, qp, tick) -> None:
        """As joint-space, and a weight that must be given."""
        super().declare(qp, tick)
        example = self.value + 0 * tick.q[:2] if self.has_example else None
        weight = tick.parameter("posture_weight", None, size=2, lowest=0.0, positive=True, example=example)
        qp.minimize(qp.variables["qd"][:2], weight=1e-3 * weight, name="posture")


@pytest.mark.parametrize(
    ("formulation", "message"),
    [
        (Guessed(), r"^posture_weight: expected a default, or an example to record ticks with, got neither; "),
        (Guessed(has_example=True, value=-1.0), r"^posture_weight: expected as example 2 numbers above 0"),
    ],
)
def test_without_a_usable_example_nothing_is_exported(formulation, message, tmp_path: Path) -> None:
    for export in (export_c, export_guiding):
        with pytest.raises(ExportError, match=message):
            export(arm("ur5e"), formulation, "free", tmp_path / "out")
        assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_a_formulation_of_ones_own_with_an_example_is_exported(tmp_path: Path) -> None:
    export_c(arm("ur5e"), Guessed(has_example=True), "free", tmp_path)
    assert run(tmp_path, "main.c").returncode == 0


def test_a_session_that_is_not_solved_is_no_record(tmp_path: Path) -> None:
    """`line:z` locks the rows of the remote centre, up to rounding: nothing to compare commands with."""
    with pytest.raises(ExportError, match=r"expected a session to record .* in mode line:z at tick"):
        export_guiding(arm("ur5e"), "joint-space + remote-centre", "line:z", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_examples_are_what_they_are_said_to_be() -> None:
    robot, rng = arm("lbr_med14"), np.random.default_rng(0)
    formulation = get_formulation("joint-space + remote-centre + elbow-hold(correct=true)")
    inputs = lower(formulation, robot, Mode.free()).inputs
    for _ in range(3):
        q = robot.random_configuration(rng)
        found = example_inputs(inputs, q)
        assert set(found) == {"remote_centre_pivot", "elbow_hold_angle"}
        ahead = robot.pose(q)[:3, :3].T @ (found["remote_centre_pivot"] - robot.pose(q)[:3, 3])
        np.testing.assert_allclose(ahead, [0.0, 0.0, -0.1], rtol=0.0, atol=1e-12)


def test_room_that_a_mode_has_no_use_for_is_within_the_range() -> None:
    tables = stack_examples([{"a": np.array([1.0, 2.0])}, {"a": np.array([3.0])}, {}])
    np.testing.assert_array_equal(tables["a"], [[1.0, 2.0], [3.0, 3.0], [1.0, 2.0]])
