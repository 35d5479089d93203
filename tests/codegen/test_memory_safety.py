"""Arms of one to eight axes under AddressSanitizer and UBSan: no array of generated code is read or written outside."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from kinqp.codegen.model import step_code
from kinqp.codegen.render import render_step
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
# An arm whose joints all slide, for one, leaves sines unused: no matter here.
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-Wno-unused-function")
UNUSED = ("-Wno-unused-parameter", "-Wno-unused-variable", "-Wno-unused-but-set-variable")
DRIVER = Path(__file__).with_name("bits_driver.c")
PREFIX = "kinqp_bits"
AXES = range(1, 9)
# Every number of axes, every kind of generated tick and every kernel at least once, in modes with 0 to 5 locked rows.
SHORT = (
    ("minimum-velocity-norm", 1, ("free", "line:z")),
    ("joint-space", 2, ("rcm:-0.12", "line:z")),
    ("damped", 3, ("plane:1,-2,0.5", "position")),
    ("cartesian-error", 4, ("line:z", "fix-position")),
    ("hierarchical", 5, ("fix-orientation",)),
    ("task-scaling", 6, ("line:z", "free")),
    ("cartesian-error", 7, ("free",)),
    ("minimum-kinetic-energy", 8, ("rcm:-0.12",)),
)
ALL = [(formulation, axes) for formulation in available_formulations() for axes in AXES]


def check(
    folder: Path,
    robot: Robot,
    formulation: str,
    modes: tuple[str, ...],
    *,
    count: int,
    guiding: bool = False,
    flags: tuple[str, ...] = ("-DKINQP_DEBUG",),
) -> None:
    """Build a library of these modes with its assertions on, and run it over ticks of any bits."""
    parsed = [Mode.parse(mode) for mode in modes]
    code = step_code(robot, get_formulation(formulation), parsed, PREFIX)
    files = render_step(code)
    entries = sum(field.size for field in code.inputs)
    defines = [f"-DPREFIX={PREFIX}", f'-DHEADER="{PREFIX}.h"', *(["-DGUIDE"] if len(modes) > 1 else [])]
    if guiding:
        files |= render_guiding(code, robot, parsed, GuidingSettings())
        entries = robot.nv + 6
        defines = [f"-DPREFIX={PREFIX}", f'-DHEADER="{PREFIX}_guiding.h"', "-DGUIDING"]
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    sources = sorted(name for name in files if name.endswith(".c"))
    run(
        need("gcc"),
        *STRICT,
        *UNUSED,
        *SANITIZE,
        *flags,
        *defines,
        "-I.",
        DRIVER,
        *sources,
        "-o",
        "driver",
        "-lm",
        cwd=folder,
    )
    rows = hostile_rows(robot, len(modes), entries, count, seed=robot.nv)
    (folder / "ticks").write_bytes(rows.tobytes())
    run(folder / "driver", "ticks", cwd=folder)


@pytest.mark.parametrize(("formulation", "axes", "modes"), SHORT)
def test_arms_of_any_size(formulation: str, axes: int, modes: tuple[str, ...], tmp_path: Path) -> None:
    check(tmp_path, chain(axes), formulation, modes, count=1500)


@pytest.mark.long
@pytest.mark.parametrize(("formulation", "axes"), ALL)
def test_every_formulation_in_every_mode_on_arms_of_any_size(formulation: str, axes: int, tmp_path: Path) -> None:
    flags = (("-DKINQP_DEBUG",), ("-DKINQP_DEBUG", NATIVE))[axes % 2]
    check(tmp_path, chain(axes), formulation, MODES, count=20_000, flags=flags)


@pytest.mark.parametrize(
    ("formulation", "axes"),
    [("joint-space", 1), *(pytest.param(*case, marks=pytest.mark.long) for case in ALL if case != ("joint-space", 1))],
)
def test_the_guiding_controller_around_them(formulation: str, axes: int, tmp_path: Path) -> None:
    check(tmp_path, chain(axes), formulation, ("fix-orientation",), count=1500, guiding=True)
