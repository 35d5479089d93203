"""The same bits on 64-bit and 32-bit ARM as on this machine: cross-compiled, run by user-mode emulation.

`make test-arm` runs this file. Tests are skipped only where the tools are missing, Debian packages `PACKAGES`.
"""

import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from kinqp.codegen import export_c
from kinqp.solvers.active_set import sources
from kinqp.solvers.native import compiler
from tests.robots.arms import arm
from tests.solvers.test_active_set_c import build_driver, drive, problems

PACKAGES = "gcc-aarch64-linux-gnu gcc-arm-linux-gnueabihf libc6-dev-arm64-cross libc6-dev-armhf-cross qemu-user"
# As the exported CMakeLists.txt has it, with the strictest warnings besides.
FLAGS = ("-std=c99", "-O3", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-fno-math-errno")
NO_FUSING = "-ffp-contract=off"

# All that a tick gives back, every number to its last bit.
COMMANDS = r"""
#include "PREFIX.h"
#include "recorded.h"

#include <stdio.h>

#define LENGTH(array) ((int)(sizeof(array) / sizeof((array)[0])))

int main(void) {
    PREFIX_parameters parameters;
    PREFIX_default_parameters(&parameters);
    for (int tick = 0; tick < recorded_ticks; ++tick) {
        PREFIX_input input = {0};
        PREFIX_output output;
        input.mode = recorded_mode[tick];
        for (int i = 0; i < LENGTH(recorded_q[0]); ++i) input.q[i] = recorded_q[tick][i];
        for (int i = 0; i < LENGTH(recorded_v[0]); ++i) input.v[i] = recorded_v[tick][i];
        PREFIX_step(&parameters, &input, &output);
        printf("%d %d", (int)output.status, output.iterations);
        for (int i = 0; i < LENGTH(output.qd); ++i) printf(" %a", output.qd[i]);
        for (int i = 0; i < LENGTH(output.eps); ++i) printf(" %a", output.eps[i]);
        for (int i = 0; i < LENGTH(output.active); ++i) printf(" %d", output.active[i]);
        printf("\n");
    }
    return 0;
}
"""


@dataclass(frozen=True)
class Target:
    """A machine: the compiler for it, that compiler's extra arguments, and what its programs run under."""

    cc: str
    arguments: tuple[str, ...] = ()
    emulator: str = ""
    # The same with fused multiply-add, and free to use it wherever a product is added.
    fusing: tuple[str, ...] = ()

    def need(self) -> None:
        missing = [tool for tool in (self.cc, self.emulator) if shutil.which(tool) is None]
        if not missing:
            with tempfile.TemporaryDirectory() as folder:
                (Path(folder) / "empty.c").write_text('#include <stdio.h>\nint main(void) { return puts("") < 0; }\n')
                done = run(folder, self.cc, "-static", "empty.c", "-o", "empty")
            missing = [] if done.returncode == 0 else [f"the C library for {self.cc}"]
        if missing:
            pytest.skip(f"{' and '.join(missing)} not found: apt-get install {PACKAGES}")

    def command(self, program: str) -> tuple[str, ...]:
        return (self.emulator, program) if self.emulator else (program,)


TARGETS = {
    "aarch64": Target("aarch64-linux-gnu-gcc", ("-static",), "qemu-aarch64", ("-ffp-contract=fast",)),
    "arm": Target("arm-linux-gnueabihf-gcc", ("-static",), "qemu-arm", ("-ffp-contract=fast", "-mfpu=vfpv4")),
}
NATIVE = Target("")
FORMULATIONS = ("cartesian-error", "joint-space")

pytestmark = pytest.mark.long
targets = pytest.mark.parametrize("name", TARGETS)
formulations = pytest.mark.parametrize("formulation", FORMULATIONS)


def run(folder: str | Path, *line: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(line, cwd=folder, capture_output=True, text=True, check=False)


@cache
def exported(formulation: str) -> dict[str, str]:
    with tempfile.TemporaryDirectory() as folder:
        export_c(arm("lbr_med14"), formulation, "fix-orientation", folder)
        return {path.name: path.read_text() for path in Path(folder).iterdir()}


@cache
def answers(formulation: str, target: Target, *flags: str) -> tuple[str, str]:
    """Build the exported folder; what its own check says, after it passed, and the commands."""
    prefix = f"kinqp_lbr_med14_{formulation.replace('-', '_')}"
    with tempfile.TemporaryDirectory() as folder:
        for file, text in exported(formulation).items():
            (Path(folder) / file).write_text(text)
        (Path(folder) / "commands.c").write_text(COMMANDS.replace("PREFIX", prefix))

        cc = (*(compiler() if target == NATIVE else (target.cc,)), *target.arguments, *FLAGS, *flags)

        def succeed(*line: str) -> str:
            done = run(folder, *line)
            assert done.returncode == 0, f"{line}\n{done.stdout[:2000]}\n{done.stderr[:2000]}"
            return done.stdout

        succeed(*cc, "-c", f"{prefix}.c")
        for main in ("main", "commands"):
            succeed(*cc, f"{main}.c", f"{prefix}.o", "-o", main, "-lm")
        check, commands = (succeed(*target.command(f"./{main}")) for main in ("main", "commands"))
        return check, commands


def largest_difference(one: str, other: str) -> float:
    """Between the numbers (joint rates, errors) of two lists of commands, relative as in the exported check."""
    pairs = zip(one.split(), other.split(), strict=True)
    numbers = [(float.fromhex(a), float.fromhex(b)) for a, b in pairs if "0x" in a]
    return max(abs(a - b) / (1.0 + abs(b)) for a, b in numbers)


@targets
@formulations
def test_exported_folder_gives_the_same_bits(formulation: str, name: str) -> None:
    TARGETS[name].need()
    check, commands = answers(formulation, TARGETS[name], NO_FUSING)
    native_check, native = answers(formulation, NATIVE, NO_FUSING)
    assert ": ok" in check
    assert check.startswith("200 ticks, ")
    # Also the largest difference from the stored answers, the count of steps, and the sizes of all structs.
    assert check == native_check
    assert len(commands.splitlines()) == 200
    assert commands == native, f"largest difference {largest_difference(commands, native):.1e}"


@targets
@formulations
def test_fused_products_change_bits_and_little_else(formulation: str, name: str) -> None:
    """The comparison above would notice; the exported check allows it."""
    TARGETS[name].need()
    check, commands = answers(formulation, TARGETS[name], *TARGETS[name].fusing)
    _, native = answers(formulation, NATIVE, NO_FUSING)
    assert ": ok" in check
    assert 0.0 < largest_difference(commands, native) < 1e-10


@targets
def test_active_set_library_gives_the_same_bits(name: str, tmp_path: Path) -> None:
    """The catalogue and random problems, cold and warm: status, iterations, point and duals or certificates."""
    target = TARGETS[name]
    target.need()
    qps = problems(100, largest=15)
    programs = []
    for kind, cc, flags in (("native", compiler()[0], ("-O1",)), (name, target.cc, ("-O3", *target.arguments))):
        folder = tmp_path / kind
        folder.mkdir()
        for file, text in sources().items():
            (folder / file).write_text(text)
        programs.append(build_driver(folder, cc, *flags))
    native, cross = programs
    emulated = cross.with_name("emulated")
    emulated.write_text(f'#!/bin/sh\nexec {target.emulator} {cross} "$@"\n')
    emulated.chmod(0o755)
    assert drive(emulated, qps) == drive(native, qps)
