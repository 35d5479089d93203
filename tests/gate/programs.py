"""Programs that run generated ticks and judge them: the exported C, an arm as tables, a driver."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from kinqp.codegen.fields import MEMORY, field_of
from kinqp.codegen.model import step_code
from kinqp.codegen.render import render_batch, render_step
from kinqp.codegen.step import STEP_FLAGS
from kinqp.control import GuidingSettings
from kinqp.control.guiding_code import render_guiding
from kinqp.control.guiding_law import GuidingLaw
from kinqp.formulations import Mode, get_formulation
from kinqp.solvers.native import compiler
from tests.robots.arms import arm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinqp.codegen.model import StepCode
    from kinqp.robots import Robot

PREFIX: Final = "judged"
HERE: Final = Path(__file__).parent
HELPERS: Final = ("judge.h", "draw.h")


@dataclass(frozen=True)
class Verdict:
    """What a driver reports.

    Attributes
    ----------
    ticks, usable, stops : int
        Ticks that were run; among them those with a usable command, and safe stops.
    wrong : dict of str to int
        Findings of each kind.
    first : str
        The first ones, with everything that the tick was given.
    """

    ticks: int
    usable: int
    stops: int
    wrong: dict[str, int]
    first: str


@dataclass(frozen=True)
class Program:
    """A driver around one export.

    Attributes
    ----------
    path : Path
        Executable.
    """

    path: Path

    def __call__(self, ticks: int, seed: int, how: str, *, broken: int = 0) -> Verdict:
        """Run and judge so many ticks.

        Parameters
        ----------
        ticks, seed : int
            At least so many; of the random numbers.
        how : {"step", "batch", "guide", "guiding"}
            "guide": blended modes.
        broken : int
            Kind of damage done to ticks before they are judged; 0: none.
        """
        command = [self.path, str(ticks), str(seed), how, str(broken)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command}: {done.returncode}\n{done.stderr}"
        return Verdict(**json.loads(done.stdout), first=done.stderr)


def build(
    folder: Path,
    formulation: str,
    modes: Sequence[str],
    robot: str = "lbr_med14",
    *,
    guiding: bool = False,
    flags: Sequence[str] = (),
) -> Program:
    """Export a formulation, and compile it with a driver.

    Parameters
    ----------
    folder : Path
        An empty one.
    formulation, modes, robot : str
    guiding : bool
        The whole hand-guiding controller, not the step.
    flags : sequence of str
        For the compiler, in addition.
    """
    parsed = [Mode.parse(mode) for mode in modes]
    chosen = arm(robot)
    code = step_code(chosen, get_formulation(formulation), parsed, PREFIX)
    files = render_step(code) | {f"{PREFIX}_batch.c": render_batch(code)}
    driver = "step_driver.c"
    if guiding:
        files |= render_guiding(code, chosen, parsed, GuidingSettings())
        driver = "guiding_driver.c"
    files["arm.h"] = tables(code, chosen, parsed)
    files |= {name: (HERE / name).read_text(encoding="utf-8") for name in (*HELPERS, driver)}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    header = f"{PREFIX}_guiding.h" if guiding else f"{PREFIX}.h"
    own = [flag for flag in STEP_FLAGS if flag not in ("-fPIC", "-shared", "-lm")]
    common = [*compiler(), *own, *flags, "-D_GNU_SOURCE", f"-DPREFIX={PREFIX}", f'-DHEADER="{header}"', "-I."]
    units = sorted(name for name in files if name.endswith(".c"))
    _run([*common, *units, "-o", "driver", "-lm"], folder)
    return Program(folder / "driver")


def tables(code: StepCode, robot: Robot, modes: Sequence[Mode]) -> str:
    """Write the arm, the modes, and the parameters with their ranges as C."""
    model = robot.model
    tool = model.frames[model.getFrameId(robot.tip)]
    joints = [model.joints[i] for i in range(1, model.njoints)]
    placements = [*(model.jointPlacements[i] for i in range(1, model.njoints)), tool.placement]
    subspaces = [_subspace(joint) for joint in joints]
    inputs = {field.name: field for field in code.inputs}
    names = [field.name for field in code.parameters]
    settings = [
        field_of(given) for given in GuidingLaw(robot, modes[0], GuidingSettings()).settable if given.name not in names
    ]
    per_tick = [name for name in inputs if name not in ("q", "v")] + [name for name in names if name in MEMORY]
    text = [
        "#include <stddef.h>",
        *(f"#define {name} {value}" for name, value in _constants(code, modes, inputs, names).items()),
        f"#define BATCH_ARGUMENTS {''.join(f'{name}, ' for name in per_tick)}",
        f"#define TRANSITION(p) {'(&(p)->transition)' if len(modes) > 1 else '((const double *)NULL)'}",
        _array("double", "placement_rotation[NV + 1][9]", [placement.rotation.ravel() for placement in placements]),
        _array("double", "placement_position[NV + 1][3]", [placement.translation for placement in placements]),
        _array("double", "joint_axis[NV][3]", [part[3:] if part[3:].any() else part[:3] for part in subspaces]),
        _array("int", "prismatic[NV]", [int(not part[3:].any()) for part in subspaces]),
        _array("int", "mode_m_free[MODES]", [mode.m_free for mode in modes]),
        _array("int", "mode_m_fixed[MODES]", [mode.m_fixed for mode in modes]),
        _array("int", "mode_fixed[MODES][6]", [(*mode.fixed_rows, *[0] * (6 - mode.m_fixed)) for mode in modes]),
        _array("int", "mode_in_tool[MODES]", [int(mode.frame == "tool") for mode in modes]),
        _array("double", "mode_axes[MODES][9]", [np.ravel(mode.axes) for mode in modes]),
        _array("double", "mode_depth[MODES]", [mode.depth for mode in modes]),
        "typedef struct { const char *name; size_t offset; int size; double least, most; } field;",
        'static const field transition_field = {"transition", 0, 1, 0.0, 1.7976931348623157e308};',
        _fields("fields", f"{PREFIX}_parameters", code.parameters),
        "#ifdef JUDGED_GUIDING_H",
        _fields("settings", f"{PREFIX}_guiding_parameters", settings),
        "#endif",
    ]
    return "\n".join(text) + "\n"


def _constants(code: StepCode, modes: Sequence[Mode], inputs: Any, names: list[str]) -> dict[str, int]:
    return {
        "NV": code.nv,
        "MODES": len(modes),
        "BLENDS": int(len(modes) > 1),
        "M_FREE": code.m_free,
        "ROWS": code.rows,
        "BRAKES": int("qd_prev" in inputs),
        "SAMPLED": int(code.sampled),
        "LIMITS_ACCELERATION": int(code.limits_acceleration),
        "HAS_V_FIXED": int("v_fixed" in inputs and inputs["v_fixed"].size > 0),
        "V_FIXED": inputs["v_fixed"].size if "v_fixed" in inputs else 0,
        "HAS_QDD_PREV": int("qdd_prev" in names),
        "FIELDS": len(names),
        "P_Q_MIN": names.index("q_min") + 1,
        "P_Q_MAX": names.index("q_max") + 1,
    }


def _subspace(joint: Any) -> Any:
    """Unit twist of a joint in its own frame: linear, then angular."""
    data = joint.createData()
    joint.calc(data, np.array([1.0, 0.0]) if joint.nq == 2 else np.zeros(1), np.zeros(1))
    return np.asarray(data.S).ravel()


def _array(kind: str, name: str, values: Any) -> str:
    return f"static const {kind} {name} = {_braces(values)};"


def _braces(values: Any) -> str:
    if np.ndim(values):
        return "{" + ", ".join(_braces(value) for value in values) + "}"
    return repr(values) if isinstance(values, int) else f"{float(values):.17g}"


def _fields(name: str, struct: str, fields: Any) -> str:
    rows = (
        f'{{"{field.name}", offsetof({struct}, {field.name}), {field.size}, {field.least}, {field.most}}},'
        for field in fields
    )
    return "\n".join([f"#include <float.h>\n#include <math.h>\nstatic const field {name}[] = {{", *rows, "};"])


def _run(command: Sequence[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=os.environ)
    assert done.returncode == 0, f"{command}\n{done.stderr}"
