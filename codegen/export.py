"""Writing a step as a folder that builds and checks itself without Python."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from ..formulations import ABOVE, DEFAULT_DT, Evaluator, Mode, get_formulation, levels_of, lower
from ..solvers import get_solver
from ..solvers.native import CompilerError, compiler
from .emit import number
from .fields import identifier
from .model import step_code
from .render import environment, library_version, render_step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..formulations import Formulation
    from ..robots import Robot
    from ..solvers import Solver
    from .model import StepCode

    Array = NDArray[np.float64]

TICKS_PER_MODE: Final = 200
TOLERANCE: Final = 1e-9
_FLAGS: Final = ("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-tree-vectorize")
# The hand moves this much per tick [m/s, rad/s]; fast, so that a short record meets limits.
_HAND_SPEED: Final = 0.4


class ExportError(ValueError):
    """A step can't be exported as asked; the message names what and why."""


@dataclass(frozen=True)
class Recorded:
    """Ticks and the answers to them: mode (N,), q, qd (N, nv), v (N, m_free); start (N,), 1 where the arm was at rest.

    Elsewhere the last command is that of the tick before, and the last acceleration what led to it.
    """

    mode: NDArray[np.int64]
    start: NDArray[np.int64]
    q: Array
    v: Array
    qd: Array


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
        When no modes are given, one is given twice, or the name is no C identifier.
    """
    made = get_formulation(formulation)
    given = [modes] if isinstance(modes, str | Mode) else list(modes)
    parsed = [Mode.parse(mode) if isinstance(mode, str) else mode for mode in given]
    texts = [str(mode) for mode in parsed]
    if not parsed or len(set(texts)) < len(texts):
        raise ExportError(f"modes: expected at least one, each once, got {', '.join(texts) or 'none'}")
    prefix = identifier(f"kinqp_{robot.name}_{made.name}") if name is None else name
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


def record(robot: Robot, formulation: Formulation, modes: Sequence[Mode]) -> Recorded:
    """Run every mode in closed loop through the interpreted path, from where every other joint is close to its limit.

    Ticks whose answer the solver itself doesn't vouch for are left out; after one the arm is at rest again.
    """
    low = np.where(np.isfinite(robot.q_min), robot.q_min, -np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, np.pi)
    rng = np.random.default_rng(0)
    columns: list[tuple[int, bool, Array, Array, Array]] = []
    for index, mode in enumerate(modes):
        levels = [Evaluator(lower(level, robot, mode)) for level in levels_of(formulation)]
        solver = get_solver("active-set", tolerance=1e-10)
        q = low + (0.25 + 0.5 * rng.random(robot.nv)) * (high - low)
        q[1::2] = high[1::2] - 1e-3  # several at once, so that the solver has something to do
        start, qd, qdd = True, np.zeros(robot.nv), np.zeros(robot.nv)
        amplitude = _HAND_SPEED * rng.uniform(0.5, 1.0, mode.m_free)
        phase = rng.uniform(0.0, 2.0 * np.pi, mode.m_free)
        for tick in range(TICKS_PER_MODE):
            v = amplitude * np.sin(phase + 2.0 * np.pi * tick / TICKS_PER_MODE)
            command = _command(levels, solver, {"q": q, "v": v, "qd_prev": qd, "qdd_prev": qdd})
            if command is None:
                start, qd, qdd = True, np.zeros(robot.nv), np.zeros(robot.nv)
                q = q + 1e-3 * rng.normal(size=robot.nv)
                continue
            columns.append((index, start, q, v, command))
            start, qd, qdd = False, command, (command - qd) / DEFAULT_DT
            q = q + DEFAULT_DT * qd
    if not columns:
        raise ExportError(f"{formulation.name} on {robot.name}: expected ticks that can be solved, got none")
    widest = max(mode.m_free for mode in modes)
    return Recorded(
        np.array([index for index, *_ in columns]),
        np.array([int(start) for _, start, *_ in columns]),
        np.array([q for _, _, q, _, _ in columns]),
        np.array([np.pad(v, (0, widest - len(v))) for *_, v, _ in columns]),
        np.array([qd for *_, qd in columns]),
    )


def _command(levels: Sequence[Evaluator], solver: Solver, given: dict[str, Array]) -> Array | None:
    """Command at a state; none where a level is not solved."""
    for evaluate in levels:
        names = {each.name for each in evaluate.inputs}
        instance = evaluate(**{name: value for name, value in given.items() if name in names})
        solution = solver.solve(instance.qp)
        if not solution.solved:
            return None
        given = given | {ABOVE: instance.K @ solution.x + instance.k}
    return given[ABOVE]


def recorded_header(recorded: Recorded, code: StepCode, *, remembers: bool) -> str:
    """Write recorded ticks as a C header of constant tables; `remembers`: with where the memory of main.c starts."""
    lines = [
        "/* Recorded ticks and the answers to them: see main.c. */",
        f"#ifndef {code.prefix.upper()}_RECORDED_H",
        f"#define {code.prefix.upper()}_RECORDED_H",
        "",
        f"enum {{ recorded_ticks = {len(recorded.mode)} }};",
        "",
        f"static const int recorded_mode[recorded_ticks] = {{{', '.join(map(str, recorded.mode))}}};",
    ]
    if remembers:
        lines += ["", "/* 1: the arm is at rest, and what was sent before is of no account */"]
        lines += [f"static const int recorded_start[recorded_ticks] = {{{', '.join(map(str, recorded.start))}}};"]
    units = {"q": "rad or m", "v": "m/s, rad/s", "qd": "rad/s or m/s"}
    for name, unit in units.items():
        table: Array = getattr(recorded, name)
        lines += ["", f"/* [{unit}] */", f"static const double recorded_{name}[recorded_ticks][{table.shape[1]}] = {{"]
        lines += [f"    {{{', '.join(number(float(x)) for x in row)}}}," for row in table]
        lines.append("};")
    return "\n".join([*lines, "", "#endif", ""])


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
