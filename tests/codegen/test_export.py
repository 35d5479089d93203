"""The exported folder: complete, self-checking, reproducible."""

import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from kinqp.codegen import ExportError, export_c
from kinqp.formulations import Mode, ModeError
from kinqp.formulations.rate import JERK_TIME
from kinqp.robots import load_robot
from kinqp.solvers.native import compiler
from tests.robots.arms import arm

FILES = {"CMakeLists.txt", "README.md", "main.c", "recorded.h"}
STRICT = ("-std=c99", "-O0", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off")


@cache
def exported(formulation: str, modes: tuple[str, ...], robot: str = "lbr_med14") -> dict[str, str]:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        export_c(arm(robot), formulation, modes, folder)
        return {path.name: path.read_text() for path in Path(folder).iterdir()}


def check(folder: Path, *flags: str) -> subprocess.CompletedProcess[str]:
    """Build the check with the strictest warnings, without cmake, and run it."""
    sources = sorted(path.name for path in folder.glob("*.c"))
    line = [*compiler(), *STRICT, *flags, *sources, "-o", "check", "-lm"]
    built = subprocess.run(line, cwd=folder, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr[:2000]
    return subprocess.run(["./check"], cwd=folder, capture_output=True, text=True, check=False)


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).write_text(text)


def table(header: str, name: str) -> list[list[float]]:
    """One of the tables of recorded.h, row by row."""
    rows = header.partition(f" recorded_{name}[")[2].partition("};")[0].splitlines()[1:]
    return [[float(x) for x in row.strip(" {},").split(",")] for row in rows if row.strip()]


ROBUST_CASES = {
    "joint-space-robust": (("fix-orientation", "rcm:-0.1"), "lbr_med14"),
    "cartesian-error-robust": (("line:z",), "ur5e"),
}
CASES = [
    ("cartesian-error", ("fix-orientation",), "lbr_med14"),
    ("joint-space", ("fix-orientation",), "lbr_med14"),
    ("cartesian-error", ("line:z", "fix-position", "rcm:-0.1"), "lbr_med14"),
    ("joint-space", ("plane:0,1,0",), "ur5"),
    ("hierarchical", ("fix-orientation", "free"), "lbr_med14"),
    ("joint-space-robust", ("fix-orientation", "rcm:-0.1"), "lbr_med14"),
    ("cartesian-error-robust", ("line:z",), "ur5e"),
]


@pytest.mark.parametrize(("formulation", "modes", "robot"), CASES)
def test_exported_code_gives_the_recorded_answers(
    formulation: str, modes: tuple[str, ...], robot: str, tmp_path: Path
) -> None:
    files = exported(formulation, modes, robot)
    assert set(files) >= FILES
    assert len([name for name in files if name.endswith(".c")]) == 2
    write(tmp_path, files)
    done = check(tmp_path)
    assert done.returncode == 0, done.stdout
    assert f"{200 * len(modes)} ticks" in done.stdout
    assert ": ok" in done.stdout


def test_recorded_ticks_meet_limits(tmp_path: Path) -> None:
    write(tmp_path, exported("cartesian-error", ("fix-orientation",)))
    assert " 0 active-set steps at most" not in check(tmp_path).stdout


def test_a_wrong_answer_is_noticed(tmp_path: Path) -> None:
    files = dict(exported("cartesian-error", ("fix-orientation",)))
    source = "kinqp_lbr_med14_cartesian_error.c"
    assert "parameters->dt = 0.001;" in files[source]
    files[source] = files[source].replace("parameters->dt = 0.001;", "parameters->dt = 0.01;")
    write(tmp_path, files)
    done = check(tmp_path)
    assert done.returncode == 1
    assert "FAILED" in done.stdout


@pytest.mark.parametrize("formulation", ["joint-space-robust", "cartesian-error-robust"])
@pytest.mark.parametrize(
    "forgotten",
    [
        "parameters.qdd_prev[i] = change[i];",
        "input.qd_prev[i] = sent[i];",
        "change[i] = output.stop == KINQP_STOP_NONE ? (now[i] - sent[i]) / parameters.dt : 0.0;",
        "sent[i] = now[i];",
    ],
)
def test_the_check_needs_last_command_and_acceleration(formulation: str, forgotten: str, tmp_path: Path) -> None:
    files = dict(exported(formulation, *ROBUST_CASES[formulation]))
    assert files["main.c"].count(forgotten) == 1
    files["main.c"] = files["main.c"].replace(forgotten, "(void)0;")
    write(tmp_path, files)
    # What is forgotten leaves a variable unused, which is an error otherwise, and not what is to be found here.
    done = check(tmp_path, "-Wno-unused-but-set-variable", "-Wno-unused-variable")
    assert done.returncode == 1
    assert "FAILED" in done.stdout


def test_recorded_accelerations_keep_to_the_jerk_limit() -> None:
    """From rest, in a mode whose locked rows force little; with the last acceleration unknown it's all at once."""
    files = exported("joint-space-robust", *ROBUST_CASES["joint-space-robust"])
    qd = np.vstack([np.zeros(7), np.zeros(7), table(files["recorded.h"], "qd")[:200]])
    jerk = np.abs(np.diff(qd, n=2, axis=0)).max(axis=1) / 1e-3 / arm("lbr_med14").qdd_max.max()
    assert jerk.max() < 1.25 * 1e-3 / JERK_TIME
    assert np.median(jerk) > 0.9 * 1e-3 / JERK_TIME


def test_what_remembers_nothing_is_given_no_memory() -> None:
    files = exported("joint-space", ("fix-orientation",))
    for text in ("sent", "qd_prev", "recorded_start"):
        assert text not in files["main.c"] + files["recorded.h"]
        assert text not in files["README.md"].replace("send output.qd", "").replace("represent", "")
    files = exported("joint-space-robust", *ROBUST_CASES["joint-space-robust"])
    change = "output.stop == KINQP_STOP_NONE ? (output.qd[i] - sent[i]) / parameters.dt : 0.0;"
    for line in ("input.qd_prev[i] = sent[i];", f"parameters.qdd_prev[i] = {change}"):
        assert line in files["README.md"]
    assert "parameters.qdd_prev[i] = 0.0;" in files["README.md"]


def test_the_same_bytes_every_time(tmp_path: Path) -> None:
    first = exported("cartesian-error", ("fix-orientation",))
    export_c(load_robot("lbr_med14"), "cartesian-error", "fix-orientation", tmp_path)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == first


@pytest.mark.skipif(shutil.which("cmake") is None, reason="cmake is optional; the check is built without it above")
def test_cmake_builds_and_ctest_passes(tmp_path: Path) -> None:
    write(tmp_path, exported("cartesian-error", ("fix-orientation",)))
    for line in (["cmake", "-S", ".", "-B", "b"], ["cmake", "--build", "b"], ["ctest", "--test-dir", "b"]):
        done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_every_field_has_a_comment_with_its_unit() -> None:
    header = exported("joint-space", ("fix-orientation",))["kinqp_lbr_med14_joint_space.h"]
    structs = header[header.index("typedef struct") :]
    fields = [line for line in structs.splitlines() if line.startswith("    ") and ";" in line]
    assert len(fields) > 15
    for field in fields:
        assert "/* " in field, field
        assert "[" in field.partition("/*")[2] or "KINQP_" in field, field


def test_readme_names_modes_and_sizes() -> None:
    readme = exported("cartesian-error", ("line:z", "fix-position", "rcm:-0.1"))["README.md"]
    for text in ("line:z", "fix-position", "rcm:-0.1", "| code and constants |", "| stack, deepest call |", "1 kHz"):
        assert text in readme


@pytest.mark.parametrize(
    ("modes", "name", "message"),
    [
        ([], None, "modes: expected at least one, each once, got none"),
        (["line:z", "line z"], None, "each once, got line:z, line:z"),
        (["free"], "9lives", "name: expected a C identifier"),
        (["free"], "two words", "name: expected a C identifier"),
    ],
)
def test_mistakes_are_named(modes: list[str], name: str | None, message: str, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=message):
        export_c(load_robot("lbr_med14"), "cartesian-error", modes, tmp_path / "out", name=name)
    assert not (tmp_path / "out").exists()


def test_a_file_in_the_way_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("precious")
    with pytest.raises(ExportError, match="expected a folder, got the file"):
        export_c(load_robot("lbr_med14"), "cartesian-error", "free", tmp_path / "out")
    assert (tmp_path / "out").read_text() == "precious"


def test_line_z_may_be_written_with_a_space() -> None:
    assert Mode.parse("line z") == Mode.parse("line:z")
    with pytest.raises(ModeError):
        Mode.parse("line z x")
