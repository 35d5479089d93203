"""The generated C itself: reproducible, portable, clean under sanitizers, without memory of its own, bit-exact."""

import functools
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from kinqp.codegen import compile_step
from kinqp.codegen.fields import identifier, mode_symbols
from kinqp.codegen.model import StepCode, step_code
from kinqp.codegen.render import render_step
from kinqp.codegen.step import STEP_FLAGS
from kinqp.formulations import Mode, get_formulation
from kinqp.solvers.native import build_library
from tests.codegen.compiled import FORMULATIONS, SPEEDS, Everything, build_all, code, compiled, near, sources
from tests.formulations.reference import MODES
from tests.programs import need, run
from tests.robots.arms import arm

Array = NDArray[np.float64]
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off")
SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")
DRIVER = Path(__file__).with_name("generated_driver.c")
# All that generated code may ask of others: mathematics, and what compilers make of loops over arrays.
ALLOWED = {"sin", "cos", "sincos", "sqrt", "fmin", "fmax", "memset", "memcpy", "memmove", "__stack_chk_fail"}

compilers = pytest.mark.parametrize("compiler_name", ["gcc", "clang"])


@functools.cache
def several(formulation: str, *modes: str) -> StepCode:
    """Work out a library of several modes."""
    chosen = Everything() if formulation == "everything" else get_formulation(formulation)
    return step_code(arm("lbr_med14"), chosen, [Mode.parse(mode) for mode in modes], identifier(f"kinqp_{formulation}"))


def write(folder: Path, made: StepCode) -> Path:
    """Write header and source; return the source's path."""
    for name, text in render_step(made).items():
        (folder / name).write_text(text)
    return folder / f"{made.prefix}.c"


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_rendering_twice_gives_the_same_bytes(formulation: str) -> None:
    def render() -> dict[str, str]:
        modes = [Mode.parse(mode) for mode in ("fix-orientation", "rcm:-0.12")]
        return render_step(step_code(arm("ur5e"), get_formulation(formulation), modes, "kinqp_twice"))

    assert render() == render()


ELSEWHERE = """
import sys
from kinqp.codegen import compile_step
from kinqp.codegen.model import step_code
from kinqp.codegen.render import render_step
from kinqp.formulations import Mode, get_formulation
from kinqp.robots import load_robot
for name in sys.argv[1:]:
    modes = [Mode.parse(mode) for mode in ("fix-orientation", "rcm:-0.12")]
    for text in render_step(step_code(load_robot("ur5e"), get_formulation(name), modes, "kinqp_elsewhere")).values():
        sys.stdout.write(text)
"""


def test_another_process_gives_the_same_bytes(tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONHASHSEED": "1"}
    command = [sys.executable, "-c", ELSEWHERE, *FORMULATIONS]
    text = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=True).stdout
    modes = [Mode.parse(mode) for mode in ("fix-orientation", "rcm:-0.12")]
    here = [
        text
        for name in FORMULATIONS
        for text in render_step(step_code(arm("ur5e"), get_formulation(name), modes, "kinqp_elsewhere")).values()
    ]
    assert text.decode() == "".join(here)


def test_paths_and_times_stay_out_of_the_source() -> None:
    text = "".join(render_step(code("lbr_med14", "joint-space", "fix-orientation")).values())
    assert not re.search(r"/(home|tmp|usr|work|root)/|\b20\d\d-\d\d-\d\d", text)


@compilers
@pytest.mark.parametrize("formulation", [*FORMULATIONS, "everything"])
def test_compiles_without_a_warning(tmp_path: Path, formulation: str, compiler_name: str) -> None:
    modes = MODES if formulation != "everything" else ("fix-orientation",)
    source = write(tmp_path, several(formulation, *modes))
    run(need(compiler_name), *STRICT, "-fsyntax-only", source.name, cwd=tmp_path)


@pytest.mark.parametrize("mode", ["free", "line:z"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_the_smallest_and_the_largest_mode_stand_alone(tmp_path: Path, formulation: str, mode: str) -> None:
    """Without locked rows there is no `v_fixed`, and C99 has no empty arrays; with one variable loops are empty."""
    source = write(tmp_path, several(formulation, mode))
    run(need("gcc"), *STRICT, "-fsyntax-only", source.name, cwd=tmp_path)


def test_a_task_that_leaves_no_freedom_compiles_and_runs(tmp_path: Path) -> None:
    """Six joints, six hard rows: nothing is left to optimise, and C99 has no arrays of size zero."""
    made = get_formulation("minimum-velocity-norm(task=hard)")
    source = write(tmp_path, step_code(arm("ur5e"), made, [Mode.parse("free")], "kinqp_square"))
    run(need("gcc"), *STRICT, "-O1", "-c", source.name, "-o", "step.o", cwd=tmp_path)
    q, v = np.array([0.1, -1.0, 1.2, 0.3, 1.0, 0.2]), np.full(6, 0.01)
    result = compile_step(arm("ur5e"), made, "free")(q, v)
    np.testing.assert_allclose(result.qd, np.linalg.solve(arm("ur5e").jacobian(q), v), rtol=0, atol=1e-12)


def test_is_a_c_plus_plus_header(tmp_path: Path) -> None:
    made = several("joint-space", *MODES)
    write(tmp_path, made)
    main = f"int main() {{ return {made.prefix.upper()}_FREE; }}"
    (tmp_path / "user.cpp").write_text(f'#include "{made.prefix}.h"\n{main}\n')
    strict = ("-std=c++11", "-Wall", "-Wextra", "-pedantic", "-Werror")
    run(need("g++"), *strict, "-fsyntax-only", "user.cpp", cwd=tmp_path)


@compilers
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_no_allocations_no_globals_only_prefixed_symbols(tmp_path: Path, formulation: str, compiler_name: str) -> None:
    source = write(tmp_path, several(formulation, "fix-orientation"))
    # Optimised, because some warnings come of that only.
    run(need(compiler_name), *STRICT, "-O1", "-c", source.name, "-o", "step.o", cwd=tmp_path)
    symbols = [line.split()[-2:] for line in run(need("nm"), "step.o", cwd=tmp_path).splitlines()]
    assert {name for kind, name in symbols if kind == "U"} <= ALLOWED
    # Code and constants only: D, B, C and the like would be memory that outlives a call.
    assert {kind for kind, _ in symbols} <= set("TtrRU")
    public = {name for kind, name in symbols if kind.isupper() and kind != "U"}
    prefix = several(formulation, "fix-orientation").prefix
    assert public == {f"{prefix}_step", f"{prefix}_default_parameters"}
    assert prefix.startswith("kinqp_")
    sizes = run(need("size"), "step.o", cwd=tmp_path).splitlines()[1].split()
    assert sizes[1:3] == ["0", "0"]  # .data, .bss


def test_the_library_exports_nothing_else() -> None:
    step = compiled("lbr_med14", "joint-space", "fix-orientation")
    library = build_library(
        step.code.prefix, sources(("lbr_med14", "joint-space", "fix-orientation")), flags=STEP_FLAGS
    )
    listed = run(need("nm"), "-D", "--defined-only", library, cwd=library.parent)
    names = {line.split()[-1] for line in listed.splitlines()}
    assert {name for name in names if not name.startswith("kinqp_")} <= {"_init", "_fini"}


def hostile_ticks(modes: tuple[str, ...], m_free: int, count: int) -> Array:
    """Draw rows for the driver: ordinary, on limits, far out, not finite, with caps, with modes that do not exist."""
    robot, rng = arm("lbr_med14"), np.random.default_rng(13)
    rows = []
    for index in range(count):
        q = near(robot.q_min, robot.q_max, rng) if index % 3 else robot.random_configuration(rng)
        v = rng.normal(size=m_free) * rng.choice(SPEEDS)
        if index % 11 == 0:
            q = np.zeros(7) if index % 2 else q * 1e-7
        if index % 13 == 0:
            q[rng.integers(7)] = rng.choice([np.nan, np.inf, -np.inf, 1e300, -1e22, 1e4, 5e-324, -0.0])
        if index % 17 == 0:
            v[rng.integers(m_free)] = rng.choice([np.nan, np.inf, 1e300, 1e155, 1e12, 5e-324])
        mode = rng.integers(len(modes)) if index % 101 else rng.choice([-1, len(modes), 2**30])
        rows.append([mode, rng.choice([-1, -1, -1, 0, 1, 2, 5]), rng.integers(2), *q, *v])
    return np.array(rows)


@functools.cache
def answers_of_steps(formulation: str, modes: tuple[str, ...], count: int) -> tuple[Array, Array]:
    """Return the hostile ticks and, for those without a cap in the first mode, the steps' answers."""
    drawn = hostile_ticks(modes, several(formulation, *modes).m_free, count)
    plain = (drawn[:, 0] == 0) & (drawn[:, 1] < 0) & (drawn[:, 2] == 0)
    step = compiled("lbr_med14", formulation, modes[0])
    result = step.batch(drawn[plain, 3:10], drawn[plain, 10 : 10 + step.mode.m_free])
    answers = np.full((count, 9), np.nan)
    answers[plain] = np.column_stack([result.codes, result.iterations, result.qd])
    return drawn, answers


@pytest.mark.parametrize(
    ("formulation", "compiler_name"),
    [
        ("joint-space", "gcc"),
        ("cartesian-error", "clang"),
        pytest.param("joint-space", "clang", marks=pytest.mark.long),
        pytest.param("cartesian-error", "gcc", marks=pytest.mark.long),
    ],
)
def test_sanitizers_find_nothing_and_the_bits_are_the_same(
    tmp_path: Path, formulation: str, compiler_name: str
) -> None:
    modes = ("fix-orientation", "free")
    made = several(formulation, *modes)
    source = write(tmp_path, made)
    drawn, wanted = answers_of_steps(formulation, modes, 3000)
    defines = (f'-DHEADER="{made.prefix}.h"', f"-DPREFIX={made.prefix}")
    flags = ("-std=c99", "-ffp-contract=off", *SANITIZE, *defines, "-I.")
    run(need(compiler_name), *flags, DRIVER, source.name, "-o", "driver", "-lm", cwd=tmp_path)
    (tmp_path / "ticks").write_bytes(drawn.tobytes())
    run(tmp_path / "driver", "ticks", "answers", cwd=tmp_path)
    answers = np.fromfile(tmp_path / "answers").reshape(len(drawn), -1)
    status, qd = answers[:, 0], answers[:, 2:9]
    # Whatever goes in, what comes out is finite; zero unless solved, or capped while `feasible`.
    assert np.isfinite(qd).all()
    usable = (status == 0) | ((status == 1) & (drawn[:, 2] == 1))
    assert not qd[~usable].any()
    robot = arm("lbr_med14")
    assert (np.abs(qd) <= robot.qd_max + 1e-8).all()
    known = (drawn[:, 0] >= 0) & (drawn[:, 0] < len(modes))
    finite = np.isfinite(drawn[:, 3:]).all(axis=1)
    sizes = np.array([Mode.parse(mode).m_free for mode in modes])
    assert (status[~known] == 5).all()
    for row in np.flatnonzero(known & ~finite):
        used = np.isfinite(drawn[row, 3 : 10 + sizes[int(drawn[row, 0])]]).all()
        assert used or status[row] == 5
    compared = ~np.isnan(wanted[:, 0])
    assert compared.sum() > 200
    assert answers[compared, :9].tobytes() == wanted[compared].tobytes()


def test_optimisation_does_not_change_a_bit() -> None:
    """What allows the other tests to compile quickly."""
    case = ("lbr_med14", "joint-space", "fix-orientation")
    build_all([case])
    robot, rng = arm("lbr_med14"), np.random.default_rng(14)
    Q = np.array([near(robot.q_min, robot.q_max, rng) for _ in range(2000)])
    V = 2.0 * rng.normal(size=(2000, 3))
    quick, full = compiled(*case, quick=True).batch(Q, V), compiled(*case).batch(Q, V)
    assert quick.qd.tobytes() == full.qd.tobytes()
    assert quick.sides.tobytes() == full.sides.tobytes()
    assert quick.iterations.tobytes() == full.iterations.tobytes()


def test_identifiers_are_plain_c() -> None:
    assert identifier("kinqp_LBR Med-14 R820.urdf") == "kinqp_lbr_med_14_r820_urdf"
    symbols = [mode.symbol for mode in several("cartesian-error", *MODES).modes]
    assert len(set(symbols)) == len(MODES)
    assert all(re.fullmatch(r"[a-z][a-z0-9_]*", symbol) for symbol in symbols)


TWINS = ("plane:0.1,0,5", "plane:0,1,0.5", "plane:-0.1,0,5", "plane:0,-1,0.5", "rcm:1e-3", "rcm:1e+30", "rcm:0.1")


def test_modes_have_symbols_of_their_own() -> None:
    """Names that are public stay as they are; modes that would have the same one spell out their decimal points."""
    modes = [Mode.parse(text) for text in (*MODES, *TWINS, "plane:0,1,0.5@tool", "line:z@world", "fix-position@tool")]
    symbols = dict(zip(map(str, modes), mode_symbols(modes), strict=True))
    assert len(set(symbols.values())) == len(modes)
    assert all(re.fullmatch(r"[a-z][a-z0-9_]*", symbol) for symbol in symbols.values())
    assert symbols["plane:0.1,0,5"] == "plane_0p1_0_5"
    assert symbols["plane:0,1,0.5"] == "plane_0_1_0p5"
    assert symbols["rcm:-0.12"] == "rcm_m0_12"
    assert symbols["plane:1,-2,0.5"] == "plane_1_m2_0_5"
    assert mode_symbols(modes[::-1]) == tuple(symbols.values())[::-1]
    for one in modes[:7]:
        assert mode_symbols([one]) == (symbols[str(one)],)


def test_any_number_and_any_name_of_a_mode_is_a_symbol() -> None:
    rng = np.random.default_rng(0)
    numbers = [0.0, -0.0, 1.0, -1.0, 0.1, 1e-3, 1e20, -1e-20, 12.0, 1.2, *rng.choice([-1.0, 1.0], 8) / 3.0]
    planes = [Mode.plane(normal) for normal in rng.choice(numbers, (3000, 3)) if np.any(normal)]
    own = [Mode(name, (0,), (1,)) for name in ("ebene", "Ebene", "\u00e4", "\u00f6", "*/", "9 lives", "")]
    modes = [*{str(mode): mode for mode in planes}.values(), *own]
    assert len(modes) > 1000
    symbols = mode_symbols(modes)
    assert len(set(symbols)) == len(modes)
    # A digit may come first: the prefix of the library stands before it.
    assert all(re.fullmatch(r"[a-z0-9][a-z0-9_]*", symbol) for symbol in symbols)


def test_modes_of_one_plain_name_build_into_one_library(tmp_path: Path) -> None:
    made = several("cartesian-error", *TWINS[:2])
    source = write(tmp_path, made)
    run(need("gcc"), *STRICT, "-fsyntax-only", source.name, cwd=tmp_path)
