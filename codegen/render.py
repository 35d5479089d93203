"""The C text of a step, from strict templates."""

from __future__ import annotations

import re
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import jinja2

from ..formulations import BOUND_TOLERANCE, FIXED_TOLERANCE
from ..solvers.active_set import embedded_source, fixed_size_sources
from .emit import number
from .fields import C_NAMES, MEMORY
from .kernels import padded

if TYPE_CHECKING:
    from .model import StepCode

_INCLUDE = re.compile(r'^#include "([^"]+)"\n', flags=re.MULTILINE)
# Matrices of the solver's problem, which its struct calls by the letters of formulas, where they are declared or read.
_MATRICES = re.compile(rf"(?<=->)[{''.join(C_NAMES)}]\b|(?<= \*)[{''.join(C_NAMES)}](?=;)")


def library_version() -> str:
    """The version that generated code names as its origin."""
    try:
        return version("kinqp")
    except PackageNotFoundError:
        return "unknown"


@cache
def environment() -> jinja2.Environment:
    """Jinja2 with undefined names as errors; one for all, since it keeps the templates that it has read."""
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(_template_text),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701  # the output is C, not HTML
    )


def render_step(code: StepCode) -> dict[str, str]:
    """Fill in header and source.

    Returns
    -------
    dict of str to str
        File name to content: ``<prefix>.h`` and ``<prefix>.c``, which need nothing but the C library.
    """
    sources = fixed_size_sources()
    values = step_values(code)
    values |= _of_one_qp(code, sources) if code.single else {"solver_source": general_solver()}
    source = "step.c.j2" if code.single else "cascade.c.j2"
    templates = environment()
    return {
        f"{code.prefix}.h": templates.get_template("step.h.j2").render(values),
        f"{code.prefix}.c": templates.get_template(source).render(values),
    }


def step_values(code: StepCode) -> dict[str, Any]:
    """What header, gate and the function around all modes are filled with, whatever solves the QP."""
    blends = len(code.modes) > 1
    return {
        "p": code.prefix,
        "title": f"{code.formulation} on {code.robot}: {', '.join(mode.text for mode in code.modes)}",
        "summary": "One control cycle of a hand-guided arm: joint positions and hand velocity in, joint rates out.",
        "version": library_version(),
        "status_header": fixed_size_sources()["kinqp_status.h"],
        "math_header": math_header(),
        "modes": code.modes,
        "parameters": code.parameters,
        "inputs": code.inputs,
        "nv": code.nv,
        "m_free": code.m_free,
        "m_fixed": code.m_fixed,
        "drift": any(field.name == "v_fixed" and field.size for field in code.inputs),
        "rows": code.rows,
        "max_iterations": code.max_iterations,
        "safe_stop": "braking" if code.brakes else "zero",
        "brake": code.brake_body,
        "brakes": code.brakes,
        "blends": blends,
        "needs_rows": blends or code.brakes or not code.single,
        "sampled": int(code.sampled),
        "limits_acceleration": code.limits_acceleration,
        "bound_tolerance": number(BOUND_TOLERANCE),
        "fixed_tolerance": number(FIXED_TOLERANCE),
        "joint_stride": padded(code.nv),
    }


def _of_one_qp(code: StepCode, sources: dict[str, str]) -> dict[str, Any]:
    """What the source takes beside the rest where every mode is a single QP."""
    return {
        "solver_header": _INCLUDE.sub("", sources["kinqp_as.h"]),
        "solver_source": _flatten(_INCLUDE.sub(_keep_instantiated, sources["kinqp_as_fixed.h"]), sources),
        "sizes": [{"n": n, "m": m} for n, m in code.sizes],
        "largest": max(n for n, _ in code.sizes),
        "most_equalities": max(1, *(mode.m_eq for mode in code.single)),
        "kernels": _kernels(code),
        "row_stride": padded(code.rows),
    }


def render_batch(code: StepCode) -> str:
    """Fill in the function that Python calls for many ticks at once."""
    signals = [field for field in code.inputs if field.name not in ("q", "v")]
    memory = [field for field in code.parameters if field.name in MEMORY]
    values = {"p": code.prefix, "nv": code.nv, "m_free": code.m_free, "rows": code.rows}
    return environment().get_template("batch.c.j2").render(values | {"signals": signals, "memory": memory})


def general_solver() -> str:
    """Source of the solver for sizes known at run time, in names that no user's macro replaces; see `C_NAMES`."""
    return _MATRICES.sub(lambda match: C_NAMES[match[0]], embedded_source("KINQP_INLINE"))


def math_header() -> str:
    """Vectors of four numbers, and elementary functions on them."""
    return _template_text("kinqp_lanes.h") + _template_text("kinqp_math.h")


def _kernels(code: StepCode) -> str:
    """Source of the kernels that any mode calls."""
    names = ["common", *(kernel for mode in code.single for kernel in mode.kernels)]
    if any(mode.shape.diagonal for mode in code.single):
        names.append("one_row")
    if any(not mode.shape.diagonal for mode in code.single):
        names.append("cholesky")
    if any(mode.m_eq for mode in code.single):
        names.append("null_space")
    return "\n".join(_template_text(f"kernels/{name}.h") for name in dict.fromkeys(names))


def _template_text(name: str) -> str:
    return (files(__package__) / "templates" / name).read_text(encoding="utf-8")


def _keep_instantiated(match: re.Match[str]) -> str:
    return match[0] if match[1].endswith(".inc") else ""


def _flatten(text: str, sources: dict[str, str]) -> str:
    return _INCLUDE.sub(lambda match: sources.get(match[1], match[0]), text)
