"""Generated C beside a user's macros: `-DN=3` or `-DFREE=...` on the command line replaces none of its names."""

from __future__ import annotations

import functools
import re
import string
import subprocess
import tempfile
from pathlib import Path
from unittest import mock

import pytest

from kinqp.codegen import export
from kinqp.control import export_guiding
from kinqp.formulations import available_formulations
from tests.programs import need
from tests.robots.chains import chain

MODES = ("line:z", "free")
# One of each kind of generated tick: H diagonal and no equalities; with equalities or without, of rows that bound one
# variable each or of any others; several QPs in order.
KINDS = ("cartesian-error", "joint-space", "joint-space-acceleration", "hierarchical")
PREFIX = "arm"
# What a program that uses an export may define: single letters, and words that sizes are called by.
WORDS = ("NV", "NQ", "NDOF", "DOF", "EQ", "FREE", "FIXED", "LOCKED", "SIZE", "WIDTH", "STRIDE", "RANK", "ROWS", "TICKS")
MACROS = (*string.ascii_uppercase, *WORDS)
_COMMENT_OR_TEXT = re.compile(r'/\*.*?\*/|//[^\n]*|"[^"\n]*"', flags=re.DOTALL)
_CAPITALS = re.compile(r"(?<![\w.])[A-Z][A-Z0-9_]*\b")


@functools.cache
def exported(formulation: str) -> dict[str, str]:
    """Text by file name of a whole export, the hand-guiding controller and its recorded sessions included."""
    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch("kinqp.codegen.recorded.TICKS_PER_MODE", 2),
        mock.patch("kinqp.control.export_guiding.TICKS_PER_MODE", 2),
        mock.patch.object(export, "_measured", return_value=dict.fromkeys(("code", "stack", "compiler"), "")),
    ):
        export_guiding(chain(3), formulation, MODES, folder, name=PREFIX)
        return {path.name: path.read_text(encoding="utf-8") for path in Path(folder).iterdir()}


def capitals(text: str) -> set[str]:
    """Identifiers in capitals only, comments and texts aside."""
    return set(_CAPITALS.findall(_COMMENT_OR_TEXT.sub("", text)))


@functools.cache
def of_c() -> set[str]:
    """Macros of the C library's headers that generated code includes: no user redefines these."""
    headers = "".join(f"#include <{name}.h>\n" for name in ("float", "math", "stddef", "stdio"))
    line = [need("gcc"), "-std=c99", "-dM", "-E", "-"]
    listed = subprocess.run(line, input=headers, capture_output=True, text=True, check=True).stdout
    return {line.split()[1].partition("(")[0] for line in listed.splitlines()}


def own(name: str) -> bool:
    return name.startswith(("KINQP_", f"{PREFIX.upper()}_"))


@pytest.mark.parametrize(
    "formulation",
    [
        *KINDS,
        *(pytest.param(name, marks=pytest.mark.long) for name in available_formulations() if name not in KINDS),
    ],
)
def test_no_name_of_generated_code_is_one_that_a_macro_may_have(formulation: str) -> None:
    """In lower case, or behind a prefix: see `C_NAMES`."""
    for file, text in exported(formulation).items():
        if file.endswith((".c", ".h")):
            assert {name for name in capitals(text) - of_c() if not own(name)} == set(), file


@pytest.mark.parametrize("formulation", KINDS)
def test_an_export_compiles_beside_macros(formulation: str, tmp_path: Path) -> None:
    for file, text in exported(formulation).items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    defines = [f"-D{name}=3" for name in MACROS]
    files = [file for file in exported(formulation) if file.endswith(".c")]
    line = [need("gcc"), "-std=c99", "-fsyntax-only", *defines, *files]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]


def test_the_scan_finds_what_it_is_for() -> None:
    assert capitals('enum { N = 3 }; /* M */ puts("NV"); x = a.B + KINQP_ROWS * J_bar[0];') == {"N", "KINQP_ROWS"}
