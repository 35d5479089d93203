"""The C of the solver: portable, clean under sanitizers, without allocations or globals, the same bits everywhere."""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from kinqp.solvers import QP, Status, get_solver
from kinqp.solvers.active_set import STATUSES, fixed_size_sources, sources
from kinqp.solvers.catalogue import CATALOGUE
from tests.programs import need, run
from tests.solvers.random_problems import draw

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off"]
SANITIZE = ["-fsanitize=address,undefined,float-divide-by-zero", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer"]
WRAP = ["-DCOUNT_ALLOCATIONS", "-Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc"]
# All that the object files may ask of others: arithmetic, and what compilers make of loops over arrays.
ALLOWED = {"frexp", "ldexp", "sqrt", "fmax", "fmin", "memset", "memcpy", "memmove", "__stack_chk_fail"}
DRIVER = Path(__file__).with_name("active_set_driver.c")
FIELDS = ("H", "g", "A", "b", "C", "l", "u", "lb", "ub")

compilers = pytest.mark.parametrize("compiler", ["gcc", "clang"])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (sources() | fixed_size_sources()).items():
        (tmp_path / name).write_text(text)
    return tmp_path


def units(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("kinqp_*.c"))


def build_driver(folder: Path, compiler: str, *flags: str) -> Path:
    program = folder / "driver"
    run(need(compiler), *STRICT, *flags, "-I.", DRIVER, *units(folder), "-o", program, "-lm", cwd=folder)
    return program


def problems(count: int, largest: int) -> list[QP]:
    rng = np.random.default_rng(99)
    return [known.qp for known in CATALOGUE] + [draw(rng, largest).qp for _ in range(count)]


def drive(program: Path, qps: list[QP]) -> bytes:
    """Run the driver; it fails if a repeated solve differs in a bit, or if a solve allocates."""
    rng = np.random.default_rng(7)
    with (program.parent / "problems").open("wb") as file:
        for qp in qps:
            file.write(np.array([qp.n, qp.m_eq, qp.m_ineq], dtype=np.intc).tobytes())
            file.write(b"".join(getattr(qp, field).tobytes() for field in FIELDS))
            file.write(rng.integers(-1, 2, qp.m_ineq + qp.n).astype(float).tobytes())
    assert run(program, "problems", "answers", cwd=program.parent) == "differ 0, allocations 0\n"
    return (program.parent / "answers").read_bytes()


def spoil(qp: QP, field: str) -> QP:
    """Put a NaN in."""
    data = {name: getattr(qp, name).copy() for name in FIELDS}
    data[field].flat[-1] = np.nan
    return QP.trusted(**data)


@compilers
def test_compiles_without_a_warning(folder: Path, compiler: str) -> None:
    fixed = """
#define KINQP_AS_N 3
#define KINQP_AS_M 7
#include "kinqp_as_fixed.h"
kinqp_status use(kinqp_as_fixed_state *s, const double *M, const kinqp_as_options *o, double *w, kinqp_as_result *r);
kinqp_status use(kinqp_as_fixed_state *s, const double *M, const kinqp_as_options *o, double *w, kinqp_as_result *r) {
    int active[7] = {0};
    return kinqp_as_fixed_solve(s, M, M + 21, M + 28, NULL, NULL, o, w, w + 3, active, r);
}
"""
    (folder / "kinqp_use_fixed.c").write_text(fixed)
    # With optimisation, because some warnings come from what it finds out.
    run(need(compiler), *STRICT, "-O2", "-c", *units(folder), cwd=folder)


@compilers
def test_headers_suit_cpp(folder: Path, compiler: str) -> None:
    (folder / "use.cpp").write_text('#include "kinqp_as.h"\n#include "kinqp_qp.h"\n')
    run(need(compiler), "-x", "c++", "-Wall", "-Wextra", "-pedantic", "-Werror", "-fsyntax-only", "use.cpp", cwd=folder)


@pytest.mark.parametrize("compiler", ["gcc", pytest.param("clang", marks=pytest.mark.long)])
def test_sanitizers_find_nothing(folder: Path, compiler: str) -> None:
    """With the code's own assertions on its indices."""
    drive(build_driver(folder, compiler, "-O1", *SANITIZE, "-DKINQP_DEBUG"), problems(300, largest=20))


@pytest.mark.parametrize("compiler", ["gcc", pytest.param("clang", marks=pytest.mark.long)])
def test_a_users_macros_and_fast_math_do_no_harm(folder: Path, compiler: str) -> None:
    """Compilers that are told that no number is NaN leave tests for it out; loops end and NaN is found all the same."""
    names = [f"-D{name}=3" for name in ("N", "M", "NV", "EQ", "FREE", "WIDTH", "E", "K", "L", "T", "Z")]
    program = build_driver(folder, compiler, "-O1", "-ffast-math", *names)
    qps = problems(100, largest=12)
    spoilt = [spoil(qp, field) for qp in qps[::4] for field in FIELDS if getattr(qp, field).size]
    answers = drive(program, [*qps, *spoilt])
    codes = []
    for qp in [*qps, *spoilt]:
        codes.append(int(np.frombuffer(answers, np.intc, 1, 0)[0]) // 100000)
        answers = answers[2 * (4 + 8 * (2 * qp.n + qp.m_eq + qp.m_ineq)) :]
    assert codes[: len(qps)].count(0) > 0.6 * len(qps)
    assert set(codes[len(qps) :]) == {STATUSES.index(Status.FAILED)}


def test_sanitizers_would_find_it(folder: Path) -> None:
    """The same build with a workspace laid out one number too far must fail, or the test above says nothing."""
    broken = (folder / "kinqp_qp.c").read_text().replace("double *d = memory;", "double *d = (double *)memory + 64;")
    (folder / "kinqp_qp.c").write_text(broken)
    program = build_driver(folder, "gcc", "-O0", *SANITIZE)
    with pytest.raises(AssertionError, match="AddressSanitizer"):
        drive(program, problems(0, largest=1))


def test_an_allocation_would_be_counted(folder: Path) -> None:
    """`test_every_build_gives_the_same_bits` counts none; this shows that the counter counts."""
    source = folder / "kinqp_qp.c"
    line = "    kinqp_qp_work work, *k = &work;"
    assert line in source.read_text()
    source.write_text("#include <stdlib.h>\n" + source.read_text().replace(line, f"{line}\n    free(malloc(8));"))
    program = build_driver(folder, "gcc", "-O0", *WRAP)
    with pytest.raises(AssertionError, match=r"allocations [1-9]"):
        drive(program, problems(0, largest=1))


@compilers
def test_no_globals_and_nothing_but_arithmetic_from_outside(folder: Path, compiler: str) -> None:
    run(need(compiler), *STRICT, "-O1", "-fno-stack-protector", "-fPIC", "-c", *units(folder), cwd=folder)
    defined, needed = set(), set()
    for line in run(need("nm"), "-g", *sorted(path.name for path in folder.glob("*.o")), cwd=folder).splitlines():
        match = re.fullmatch(r"[0-9a-f]*\s+([A-Za-z]) (\S+)", line)
        if match:
            (needed if match[1] == "U" else defined).add(match[2])
    assert all(name.startswith("kinqp_") for name in defined)
    assert needed - defined <= ALLOWED | {"_GLOBAL_OFFSET_TABLE_"}
    symbols = run(need("nm"), *sorted(path.name for path in folder.glob("*.o")), cwd=folder)
    # b, d, c: zeroed, initialised and common variables, of any visibility.
    assert not re.search(r"^[0-9a-f]+ [bBdDcCgGsS] ", symbols, re.MULTILINE)


def test_every_build_gives_the_same_bits(folder: Path) -> None:
    """Also the one that Python uses; none of them allocates."""
    qps = problems(300, largest=25)
    builds = [("gcc", "-O0")] + [("clang", "-O3")] * (shutil.which("clang") is not None)
    answers = [drive(build_driver(folder, *build, *WRAP), qps) for build in builds]
    assert all(answer == answers[0] for answer in answers)
    solver, at = get_solver("active-set"), 0
    for qp in qps:
        size = 2 * qp.n + qp.m_eq + qp.m_ineq
        code = int(np.frombuffer(answers[0], np.intc, 1, at)[0])
        values = np.frombuffer(answers[0], np.float64, size, at + 4)
        at += 2 * (4 + 8 * size)
        solution = solver.solve(qp)
        assert solution.iterations == code % 100000
        if solution.claimed is not Status.FAILED:
            mine = np.concatenate((solution.x, solution.y, solution.z, solution.z_box))
            assert mine.tobytes() == values.tobytes()
    assert at == len(answers[0])


def test_document_compiles_and_runs(folder: Path) -> None:
    document = (Path(__file__).parents[2] / "docs" / "active-set.md").read_text(encoding="utf-8")
    (python,) = re.findall(r"```python\n(.*?)```", document, re.DOTALL)
    (code,) = re.findall(r"```c\n(.*?)```", document, re.DOTALL)
    (one_liner,) = re.findall(r'`python -c "(.*?)"`', document, re.DOTALL)
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    run(sys.executable, "-W", "error", "-c", python, cwd=elsewhere)
    run(sys.executable, "-c", one_liner, cwd=elsewhere)
    # A thumb on the first joint: without its limit w would be 0.
    call = """
#include <stdio.h>
int main(void) {
    const double M[21] = {1}, lo[7] = {0.5}, hi[7] = {1, 1, 1, 1, 1, 1, 1}, minus_v[3] = {0.75};
    double w[3];
    const int solved = step(M, lo, hi, minus_v, 0.75, w);
    printf("%d %g %g %g\\n", solved, w[0], w[1], w[2]);
    return 0;
}
"""
    declared = code.replace("int step(", "static int step(")
    (elsewhere / "step.c").write_text(declared + call)
    run(need("gcc"), *STRICT, "step.c", "-o", "step", "-lm", cwd=elsewhere)
    assert run("./step", cwd=elsewhere) == "1 0.5 0 0\n"
