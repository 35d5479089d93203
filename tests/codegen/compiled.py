"""Compiled steps, each built once per test run, and the states to run them on."""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar
from unittest import mock

import numpy as np

import kinqp.codegen.step as step_module
from kinqp.codegen import CompiledStep
from kinqp.codegen.model import StepCode, step_code
from kinqp.codegen.render import render_batch, render_step
from kinqp.codegen.step import STEP_FLAGS
from kinqp.control import InterpretedStep, make_step
from kinqp.formulations import Formulation, Mode, get_formulation
from kinqp.solvers import available_solvers
from kinqp.solvers.native import build_library
from tests.control.states import states
from tests.robots.arms import arm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinqp.formulations import QuadraticProgram, Tick

    Array = NDArray[np.float64]

FORMULATIONS = ("cartesian-error", "joint-space")
REFERENCE_SOLVER = "active-set" if "active-set" in available_solvers() else "clarabel"
# The bits of the answer do not depend on it (test_source.py), the time to compile does.
QUICK_FLAGS = tuple("-O0" if flag == "-O3" else flag for flag in STEP_FLAGS)
SPEEDS = (0.0, 1e-6, 0.01, 0.2, 2.0)

Case = tuple[str, str, str]


@functools.cache
def code(robot: str, formulation: str, mode: str) -> StepCode:
    """Work out the code of a step under the prefix that `CompiledStep` gives it."""
    chosen = Everything() if formulation == Everything.name else get_formulation(formulation)
    prefix = step_module.prefix_of(robot, chosen.name)
    return step_code(arm(robot), chosen, [Mode.parse(mode)], prefix)


def sources(case: Case) -> dict[str, str]:
    """Return the C files of a step, text by name."""
    made = code(*case)
    return render_step(made) | {f"{made.prefix}_batch.c": render_batch(made)}


@functools.cache
def compiled(
    robot: str,
    formulation: str,
    mode: str,
    *,
    quick: bool = False,
    feasible: bool = False,
    max_iterations: int | None = None,
) -> CompiledStep:
    """Return a step as `compile_step` makes it; `quick`: compiled with less optimisation."""
    chosen = Everything() if formulation == Everything.name else get_formulation(formulation)
    with (
        mock.patch.object(step_module, "STEP_FLAGS", QUICK_FLAGS if quick else STEP_FLAGS),
        mock.patch.object(step_module, "step_code", return_value=code(robot, formulation, mode)),
    ):
        return CompiledStep(arm(robot), chosen, Mode.parse(mode), feasible=feasible, max_iterations=max_iterations)


def everything() -> CompiledStep:
    """Return the step of `Everything` on the UR5e."""
    return compiled("ur5e", Everything.name, "position", quick=True)


@functools.cache
def interpreted(robot: str, formulation: str, mode: str) -> InterpretedStep:
    """Return the same step without generated code."""
    return make_step(arm(robot), formulation, mode, REFERENCE_SOLVER)


def build_all(cases: Sequence[Case]) -> None:
    """Have the libraries of many steps compiled at once, for `compiled(..., quick=True)` to find."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        jobs = [pool.submit(build_library, code(*case).prefix, sources(case), flags=QUICK_FLAGS) for case in cases]
    for job in jobs:
        assert isinstance(job.result(), Path)


def ticks(robot: str, mode: str, count: int, seed: int = 0) -> list[tuple[str, Array, Array]]:
    """Draw (kind, q, v): the kinds of `tests.control.states` in turn, all speeds."""
    rng = np.random.default_rng(seed)
    m_free = Mode.parse(mode).m_free
    return [(kind, q, rng.normal(size=m_free) * rng.choice(SPEEDS)) for kind, q in states(arm(robot), count, seed)]


def near(low: Array, high: Array, rng: np.random.Generator) -> Array:
    """Draw a state with most joints on a limit, a hair from it, or beyond it."""
    q = rng.uniform(low, high)
    side = np.where(rng.random(low.size) < 0.5, low, high)
    inwards = np.where(side == low, 1.0, -1.0)
    offset = rng.choice([0.0, 1e-17, 1e-9, 1e-5, 1e-3, 0.01, -1e-9, -1e-2], low.size)
    return np.asarray(np.where(rng.random(low.size) < 0.6, side + inwards * offset, q))


@dataclass(frozen=True)
class Everything(Formulation):
    """What the two shipped formulations leave out: a gradient, rows besides the box, inputs without defaults.

    No feasible point is declared. Of the equalities the first defines `eps` (with +1), the second nothing (2 is no
    unit), the third nothing (`slack` is bounded).
    """

    name: ClassVar[str] = "everything"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        eps, qd = qp.variable("eps", tick.m_free), qp.variable("qd", tick.nv)
        double, slack = qp.variable("double", 1), qp.variable("slack", 1)
        wish = tick.parameter("qd_wish", None, size=tick.nv)
        qp.minimize(eps, weight=1.0)
        qp.minimize(qd - 0.5 * (wish + tick.qd_prev), weight=0.01)
        qp.minimize(double - 1, weight=0.1)
        qp.minimize(slack, weight=10.0)
        qp.equal(eps, tick.J_free @ qd - tick.v, name="task")
        qp.equal(2 * double, qd[0], name="double")
        qp.equal(slack, qd[1] + qd[2], name="slide")
        qp.between(-0.01, slack, 0.02, name="slack")
        qp.between(-0.3, qd[0] - qd[1], 0.3, name="difference")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.between(tick.qd_lo, qd + 0.25 * double, tick.qd_hi, name="command limits")
        qp.command(qd + 0.25 * double)
