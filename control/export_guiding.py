"""Writing a whole hand-guiding controller as a folder of C that builds and checks itself without Python."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..codegen.emit import number
from ..codegen.examples import ExportError, example_inputs, example_lines, stack_examples
from ..codegen.export import TOLERANCE, export_c, required_fields
from ..codegen.fields import prefix_of
from ..codegen.model import step_code
from ..codegen.render import environment
from ..formulations import Mode, get_formulation, levels_of, lower
from ..solvers import Status
from .checks import checked_modes
from .guiding_code import render_guiding
from .guiding_settings import GuidingSettings
from .make_guiding import make_guiding

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ..formulations import Formulation
    from ..robots import Robot

    Array = NDArray[np.float64]

TICKS_PER_MODE: Final = 300
# The session's stop begins here, in the first mode, and ends so much later [ticks].
_STOP: Final = (150, 60)
# What the hand pulls with, along each axis, at most [N, N m].
_PULL: Final = np.array([25.0, 25.0, 25.0, 1.5, 1.5, 1.5])


def export_guiding(
    robot: Robot,
    formulation: str | Formulation,
    modes: str | Mode | Sequence[str | Mode],
    out: str | Path,
    *,
    name: str | None = None,
    settings: GuidingSettings | None = None,
) -> Path:
    """Write a hand-guiding controller, from the wrench to the command, as a C library.

    Parameters
    ----------
    robot : Robot
        From `load_robot`.
    formulation : str or Formulation
        A registered name, `module:Name`, or an instance.
    modes : str, Mode, or sequence of them
        Those that can be engaged.
    out : str or Path
        Folder to write to; made if need be.
    name : str, optional
        Prefix of files and symbols; `kinqp_<robot>_<formulation>` without it.
    settings : GuidingSettings, optional
        Defaults of the parameters.

    Returns
    -------
    Path
        The folder: what `export_c` writes, and beside it the controller with a check of its own.

    Raises
    ------
    ExportError
        As `export_c`.
    """
    chosen = settings or GuidingSettings()
    parsed = checked_modes([modes] if isinstance(modes, str | Mode) else modes)
    made = get_formulation(formulation)
    # First, so that what can't be recorded leaves no folder behind.
    table, examples = record(robot, made, parsed, chosen)
    folder = export_c(robot, made, list(parsed), out, name=name)
    prefix = prefix_of(robot.name, made.name) if name is None else name
    code = step_code(robot, made, parsed, prefix)
    files = render_guiding(code, robot, parsed, chosen)
    shared = {
        "p": prefix,
        "nv": robot.nv,
        "tolerance": number(TOLERANCE),
        "ticks": len(table["mode"]),
        "required": required_fields(code),
        "change": any(field.name == "qdd_prev" for field in code.parameters),
    }
    templates = environment()
    files["guiding_main.c"] = templates.get_template("guiding_main.c.j2").render(shared)
    files["guiding_recorded.h"] = _header(table, examples, prefix)
    for file, text in files.items():
        (folder / file).write_text(text, encoding="utf-8")
    for file, template in (("CMakeLists.txt", "guiding_cmake.j2"), ("README.md", "guiding_readme.md.j2")):
        with (folder / file).open("a", encoding="utf-8") as stream:
            stream.write(templates.get_template(template).render(shared))
    return folder


def record(
    robot: Robot, formulation: Formulation, modes: Sequence[Mode], settings: GuidingSettings
) -> tuple[dict[str, NDArray[np.float64] | NDArray[np.int64]], dict[str, Array]]:
    """Run a session through the interpreted controller: every mode in turn, one stop, joints close to their limits.

    Returns
    -------
    table : dict of str to ndarray
        `mode` and `stop`, (N,); `q`, `qd`, (N, nv), `wrench`, (N, 6).
    examples : dict of str to ndarray
        Values of the parameters without a default, each (modes, size).

    Raises
    ------
    ExportError
        Naming a parameter without a default that has no example either, or a mode in which a tick is not solved.
    """
    controller = make_guiding(robot, formulation, modes, settings=settings, tolerance=1e-10)
    low = np.where(np.isfinite(robot.q_min), robot.q_min, -np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, np.pi)
    rng = np.random.default_rng(0)
    q = low + (0.25 + 0.5 * rng.random(robot.nv)) * (high - low)
    q[1::2] = high[1::2] - 1e-3  # several at once, so that the solver has something to do
    examples = []
    for mode in modes:
        inputs = [each for level in levels_of(formulation) for each in lower(level, robot, mode).inputs]
        examples.append(example_inputs(inputs, q))
        controller.set(mode, **examples[-1])
    phase = rng.uniform(0.0, 2.0 * np.pi, 6)
    rows: list[tuple[int, int, Array, Array, Array]] = []
    for tick in range(TICKS_PER_MODE * len(modes)):
        index, within = divmod(tick, TICKS_PER_MODE)
        if within == 0 and index:
            controller.engage(modes[index])
        stop = index == 0 and _STOP[0] <= within < sum(_STOP)
        if index == 0 and within == _STOP[0]:
            controller.stop()
        if index == 0 and within == sum(_STOP):
            controller.resume()
        wrench = _PULL * np.sin(phase + 2.0 * np.pi * within / TICKS_PER_MODE)
        result = controller(q, wrench)
        if result.status is not Status.SOLVED:
            raise ExportError(
                f"{formulation.name} on {robot.name}: expected a session to record in which every tick is solved, got "
                f"{result.status.value} in mode {result.mode} at tick {within}; leave the mode out, or the "
                "constraint that locks the same rows"
            )
        rows.append((index, int(stop), q, wrench, result.qd))
        q = q + controller.dt * result.qd
    columns = zip(*rows, strict=True)
    labels = ("mode", "stop", "q", "wrench", "qd")
    table = {label: np.array(column) for label, column in zip(labels, columns, strict=True)}
    return table, stack_examples(examples)


def _header(table: dict[str, NDArray[np.float64] | NDArray[np.int64]], examples: dict[str, Array], prefix: str) -> str:
    guard = f"{prefix.upper()}_GUIDING_RECORDED_H"
    lines = [
        "/* A recorded session: see guiding_main.c. */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        f"enum {{ recorded_ticks = {len(table['mode'])} }};",
    ]
    for name in ("mode", "stop"):
        values = ", ".join(str(int(value)) for value in table[name])
        lines += ["", f"static const int recorded_{name}[recorded_ticks] = {{{values}}};"]
    for name, unit in (("q", "rad or m"), ("wrench", "N, N m"), ("qd", "rad/s or m/s")):
        rows = table[name]
        lines += ["", f"/* [{unit}] */", f"static const double recorded_{name}[recorded_ticks][{rows.shape[1]}] = {{"]
        lines += [f"    {{{', '.join(number(float(x)) for x in row)}}}," for row in rows]
        lines.append("};")
    lines += example_lines(examples)
    return "\n".join([*lines, "", "#endif", ""])
