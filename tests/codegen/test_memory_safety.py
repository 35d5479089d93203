"""Arms of one to eight axes under AddressSanitizer and UBSan: no array of generated code is read or written outside."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from kinqp.codegen.model import step_code
from kinqp.codegen.render import math_header, render_step
from kinqp.control.guiding_code import render_guiding
from kinqp.control.guiding_settings import GuidingSettings
from kinqp.formulations import Mode, available_formulations, get_formulation
from kinqp.solvers.native import NATIVE
from tests.codegen.hostile import hostile_rows
from tests.formulations.reference import MODES
from tests.programs import need, run
from tests.robots.chains import chain

if TYPE_CHECKING:
    from kinqp.robots import Robot

SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")
# What of it is about arrays, compiled in half the time.
ARRAYS_ONLY = ("-fsanitize=address,bounds,float-cast-overflow", "-fno-sanitize-recover=all")
# An arm whose joints all slide, for one, leaves sines unused: no matter here.
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-Wno-unused-function")
UNUSED = ("-Wno-unused-parameter", "-Wno-unused-variable", "-Wno-unused-but-set-variable")
DRIVER = Path(__file__).with_name("bits_driver.c")
PREFIX = "kinqp_bits"
AXES = range(1, 9)
# One of each kind of generated tick; more equalities than variables, rows that fill no vector, several modes.
SHORT = (
    ("minimum-velocity-norm", 1, ("line:z",)),
    ("cartesian-error", 2, ("rcm:-0.12",)),
    ("joint-space", 3, ("line:z",)),
    ("hierarchical", 5, ("plane:1,-2,0.5",)),
    ("task-scaling", 6, ("position", "free")),
)
ALL = [(formulation, axes) for formulation in available_formulations() for axes in AXES]


def check(
    folder: Path,
    robot: Robot,
    formulation: str,
    modes: tuple[str, ...],
    flags: tuple[str, ...],
    *,
    count: int,
    guiding: bool = False,
) -> None:
    """Build a library of these modes with its assertions on, and run it over ticks of any bits."""
    parsed = [Mode.parse(mode) for mode in modes]
    code = step_code(robot, get_formulation(formulation), parsed, PREFIX)
    files = render_step(code)
    entries = sum(field.size for field in code.inputs)
    defines = [f"-DPREFIX={PREFIX}", f'-DHEADER="{PREFIX}.h"', "-DKINQP_DEBUG"]
    if guiding:
        files |= render_guiding(code, robot, parsed, GuidingSettings())
        entries = robot.nv + 6
        defines += [f'-DHEADER="{PREFIX}_guiding.h"', "-DGUIDING"]
        defines.remove(f'-DHEADER="{PREFIX}.h"')
    elif len(modes) > 1:
        defines.append("-DGUIDE")
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    sources = sorted(name for name in files if name.endswith(".c"))
    line = [need("gcc"), *STRICT, *UNUSED, *flags, *defines, "-I.", DRIVER, *sources, "-o", "driver", "-lm"]
    run(*line, cwd=folder)
    (folder / "ticks").write_bytes(hostile_rows(robot, len(modes), entries, count, seed=robot.nv).tobytes())
    run(folder / "driver", "ticks", cwd=folder)


@pytest.mark.parametrize(("formulation", "axes", "modes"), SHORT)
def test_arms_of_any_size(formulation: str, axes: int, modes: tuple[str, ...], tmp_path: Path) -> None:
    check(tmp_path, chain(axes), formulation, modes, ARRAYS_ONLY, count=400)


@pytest.mark.long
@pytest.mark.parametrize(("formulation", "axes"), ALL)
def test_every_formulation_in_every_mode_on_arms_of_any_size(formulation: str, axes: int, tmp_path: Path) -> None:
    # Vectors of four numbers at a time, where the machine has them, and of two.
    native = (NATIVE,) if axes % 2 else ()
    check(tmp_path, chain(axes), formulation, MODES, (*SANITIZE, *native), count=20_000)


def test_the_guiding_controller_around_one_joint(tmp_path: Path) -> None:
    check(tmp_path, chain(1), "joint-space", ("fix-orientation",), ARRAYS_ONLY, count=400, guiding=True)


@pytest.mark.long
@pytest.mark.parametrize(("formulation", "axes"), ALL)
def test_the_guiding_controller_around_every_formulation(formulation: str, axes: int, tmp_path: Path) -> None:
    check(tmp_path, chain(axes), formulation, ("line:z", "free"), SANITIZE, count=20_000, guiding=True)


def test_an_assertion_that_does_not_hold_stops_a_debug_build(tmp_path: Path) -> None:
    """And is not there in any other one."""
    program = "int main(int count, char **given) { (void)given; KINQP_ASSERT(count > 1); return 0; }\n"
    text = str(math_header()) + program
    (tmp_path / "main.c").write_text(text, encoding="utf-8")
    run(need("gcc"), "-std=c99", "main.c", "-o", "plain", "-lm", cwd=tmp_path)
    run(need("gcc"), "-std=c99", "-DKINQP_DEBUG", "main.c", "-o", "debug", "-lm", cwd=tmp_path)
    run(tmp_path / "plain", cwd=tmp_path)
    with pytest.raises(AssertionError, match="expected count > 1"):
        run(tmp_path / "debug", cwd=tmp_path)
