"""Writing a step as a folder that builds and checks itself without Python."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Final

from ..formulations import Mode, get_formulation
from ..solvers.native import CompilerError, compiler
from .emit import number
from .examples import ExportError
from .fields import is_required, prefix_of
from .model import step_code
from .recorded import record, recorded_header
from .render import environment, library_version, render_step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..formulations import Formulation
    from ..robots import Robot
    from .fields import Field
    from .model import StepCode

TOLERANCE: Final = 1e-9
_FLAGS: Final = ("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-tree-vectorize")


def export_c(
    robot: Robot,
    formulation: str | Formulation,
    modes: str | Mode | Sequence[str | Mode],
    out: str | Path,
    *,
    name: str | None = None,
) -> Path:
    """Write a formulation on a robot, in one or more modes, as a C library.

    Parameters
    ----------
    robot : Robot
        From `load_robot`.
    formulation : str or Formulation
        A registered name, `module:Name`, or an instance.
    modes : str, Mode, or sequence of them
        As in `Mode.parse`; `input.mode` chooses among them at every tick, in this order.
    out : str or Path
        Folder to write to; made if need be. Files of an earlier export are replaced, others left alone.
    name : str, optional
        Prefix of files and symbols; `kinqp_<robot>_<formulation>` without it.

    Returns
    -------
    Path
        The folder. It holds one header, one source, `main.c` with recorded ticks, `CMakeLists.txt` and `README.md`, the
        same bytes for the same arguments, library and compiler.

    Raises
    ------
    ExportError
        When no modes are given, one is given twice, the name is no C identifier, or a parameter has neither a default
        nor an example to record ticks with.
    """
    made = get_formulation(formulation)
    given = [modes] if isinstance(modes, str | Mode) else list(modes)
    parsed = [Mode.parse(mode) if isinstance(mode, str) else mode for mode in given]
    texts = [str(mode) for mode in parsed]
    if not parsed or len(set(texts)) < len(texts):
        raise ExportError(f"modes: expected at least one, each once, got {', '.join(texts) or 'none'}")
    prefix = prefix_of(robot.name, made.name) if name is None else name
    if not re.fullmatch(r"[a-z_][a-z0-9_]*", prefix):
        raise ExportError(f"name: expected a C identifier in lower case, got {prefix!r}")
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise ExportError(f"out: expected a folder, got the file {folder}")

    code = step_code(robot, made, parsed, prefix)
    files = render_step(code)
    recorded = record(robot, made, parsed)
    templates = environment()
    previous = any(field.name == "qd_prev" for field in code.inputs)
    change = any(field.name == "qdd_prev" for field in code.parameters)
    shared = {
        "p": prefix,
        "nv": code.nv,
        "m_free": code.m_free,
        "rows": code.rows,
        "previous": previous,
        "change": change,
        "remembers": previous or change,
        "required": required_fields(code),
    }
    files["main.c"] = templates.get_template("main.c.j2").render(shared | {"tolerance": number(TOLERANCE)})
    files["recorded.h"] = recorded_header(recorded, code, remembers=previous or change)
    files["CMakeLists.txt"] = templates.get_template("CMakeLists.txt.j2").render(shared)
    files["README.md"] = templates.get_template("README.md.j2").render(
        shared
        | {
            "formulation": code.formulation,
            "brake": code.brakes,
            "robot": code.robot,
            "version": library_version(),
            "ticks": len(recorded.mode),
            "modes": [
                {
                    "symbol": mode_code.symbol,
                    "text": mode_code.text,
                    "free_names": mode_code.free_names,
                    "locked": ", ".join(mode.row_names[row] for row in mode.fixed_rows) or "nothing",
                    "size": mode_code.size,
                }
                for mode, mode_code in zip(parsed, code.modes, strict=True)
            ],
            "sizes": _sizes(code, files),
        }
    )
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in files.items():
        (folder / file).write_text(text, encoding="utf-8")
    return folder


def required_fields(code: StepCode) -> list[Field]:
    """Parameters that have no default."""
    names = {given.name for mode in code.modes for given in mode.inputs if is_required(given)}
    return [field for field in code.parameters if field.name in names]


def _sizes(code: StepCode, files: dict[str, str]) -> dict[str, str]:
    doubles = sum(field.size for field in code.parameters)
    signals = sum(field.size for field in code.inputs)
    integers = 4 * (code.rows + 2)
    sizes = {
        # One more double, the transition, where there are modes to switch between.
        "parameters": f"{8 * (doubles + (len(code.modes) > 1)) + 8}",
        "input": f"{8 * signals + 8}",
        "output": f"{8 * (code.nv + code.m_free) + integers + integers % 8}",
    }
    return sizes | _measured(code.prefix, files)


def _measured(prefix: str, files: dict[str, str]) -> dict[str, str]:
    """Code and stack as this machine's compiler makes them; words instead where it can't say."""
    unknown = {"code": "not measured", "stack": "not measured", "compiler": "no compiler at the time of export"}
    try:
        command = compiler()
    except CompilerError:
        return unknown
    with tempfile.TemporaryDirectory() as scratch:
        for file in (f"{prefix}.h", f"{prefix}.c"):
            (Path(scratch) / file).write_text(files[file], encoding="utf-8")
        line = [*command, *_FLAGS, "-c", f"{prefix}.c", "-o", "step.o"]
        done = subprocess.run([*line, "-fstack-usage"], cwd=scratch, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            return unknown
        version = subprocess.run([*command, "--version"], capture_output=True, text=True, check=False).stdout
        usage = Path(scratch) / "step.su"
        stack = _deepest(usage.read_text(encoding="utf-8")) if usage.exists() else "not measured"
        size = shutil.which("size")
        listed = (
            subprocess.run([size, "step.o"], cwd=scratch, capture_output=True, text=True, check=False).stdout
            if size
            else ""
        )
        rows = [row.split() for row in listed.splitlines()]
        code = rows[1][0] if len(rows) > 1 and rows[1] else "not measured"
    return {"code": code, "stack": stack, "compiler": f"{version.splitlines()[0]}, {' '.join(_FLAGS)}"}


def _deepest(usage: str) -> str:
    """Upper bound on the stack: the sum over all functions, since none calls itself."""
    return "at most " + str(sum(int(row.split("\t")[1]) for row in usage.splitlines()))
