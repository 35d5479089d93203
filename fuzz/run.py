"""Runs the fuzz targets one after the other; exit code 1 where one found something.

The targets are `urdf` (what `load_robot` reads), `step` and `guiding` (generated C, under AddressSanitizer and
UndefinedBehaviorSanitizer). What is found, the corpus and the logs stay in the folder.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

from kinqp.codegen import export_c
from kinqp.control import export_guiding
from kinqp.robots import load_robot

HERE: Final = Path(__file__).parent
#: Robot, formulation and modes: with slack and without, equalities and a null space.
STEP: Final = ("ur5e", "joint-space", ("fix-orientation", "rcm:0.1"))
GUIDING: Final = ("davinci5", "cartesian-error-robust", ("position", "line:z"))
FLAGS: Final = (
    *("-std=c99", "-g1", "-O1", "-ffp-contract=off", "-fno-sanitize-recover=all"),
    # Checks as calls: in line they make clang take minutes and gigabytes for a function of thousands of lines.
    *("-mllvm", "-asan-instrumentation-with-call-threshold=0"),
)
SANITIZERS: Final = "-fsanitize=fuzzer,address,undefined"
# A tick takes microseconds, a file milliseconds: this long is a hang [s].
TIMEOUT: Final = 20


def main() -> int:
    """Parse arguments, run, say what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="*", help="urdf, step, guiding; all without")
    parser.add_argument("--seconds", type=int, default=600, help="for each target")
    parser.add_argument("--out", type=Path, default=Path("results/fuzz"))
    options = parser.parse_args()
    targets = {"urdf": urdf, "step": lambda folder: compiled(folder, guiding=False), "guiding": compiled}
    if not set(options.targets) <= set(targets):
        parser.error(f"targets: expected some of {', '.join(targets)}, got {' '.join(options.targets)}")
    found = [name for name in options.targets or targets if not run(name, targets[name], options)]
    for name in found:
        sys.stdout.write(f"{name}: FOUND something; see {options.out / name}.log and the file that it names\n")
    return bool(found)


def run(name: str, prepare, options: argparse.Namespace) -> bool:
    """Run a target for its time; whether it found nothing."""
    folder = (options.out / name).resolve()
    (folder / "corpus").mkdir(parents=True, exist_ok=True)
    command = [
        *prepare(folder), str(folder / "corpus"), f"-max_total_time={options.seconds}", f"-timeout={TIMEOUT}",
        f"-artifact_prefix={folder}/found-", "-print_final_stats=1", "-rss_limit_mb=4096",
    ]  # fmt: skip
    with (options.out / f"{name}.log").open("wb") as log:
        # Leaks are looked for at the end by the sanitizer, which a container may not let trace the process.
        environment = os.environ | {"ASAN_OPTIONS": "detect_leaks=0"}
        code = subprocess.run(command, stdout=log, stderr=log, env=environment, check=False).returncode
    lines = (options.out / f"{name}.log").read_text(errors="replace").splitlines()
    stats = [line for line in lines if "number_of_executed_units" in line or "slowest_unit_time_sec" in line]
    sys.stdout.write(f"{name}: exit code {code}; {'; '.join(stats)}\n")
    return code == 0


def urdf(folder: Path) -> list[str]:
    """Command that fuzzes `load_robot`, from the arms of this library and those of the tests."""
    for source in (
        *(HERE.parent / "robots" / "data").glob("*.urdf"),
        *(HERE.parent / "tests" / "robots").glob("*.urdf"),
    ):
        shutil.copy(source, folder / "corpus")
    return [sys.executable, str(HERE / "urdf.py"), f"-dict={HERE / 'urdf.dict'}", "-max_len=20000"]


def compiled(folder: Path, *, guiding: bool = True) -> list[str]:
    """Command that fuzzes generated C."""
    robot, formulation, modes = GUIDING if guiding else STEP
    code = folder / "code"
    (export_guiding if guiding else export_c)(load_robot(robot), formulation, list(modes), code, name="fuzzed")
    sources = ["fuzzed.c", "fuzzed_guiding.c"] if guiding else ["fuzzed.c"]
    header = "fuzzed_guiding.h" if guiding else "fuzzed.h"
    names = (f'-DHEADER="{header}"', "-DPREFIX=fuzzed", f"-DGUIDING={int(guiding)}")
    line = [
        os.environ.get("CLANG", "clang"), *FLAGS, SANITIZERS, *names, "-I.",
        str(HERE / "step.c"), *sources, "-lm", "-o", "target",
    ]  # fmt: skip
    if subprocess.run(line, cwd=code, check=False).returncode:
        sys.exit(
            "fuzz: clang could not build the target; it needs its run-time library: apt-get install libclang-rt-14-dev"
        )
    return [str(code / "target"), "-max_len=4096"]


if __name__ == "__main__":
    sys.exit(main())
