"""What the judges of the invariants are tested on: states, and the interpreted step's answers to them."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from kinqp.benchmarks.invariants import Row, States, arm
from kinqp.benchmarks.invariants.answers import Answers, recorded_step, solve_all
from kinqp.formulations import Mode, get_formulation
from kinqp.solvers import get_solver

if TYPE_CHECKING:
    from kinqp.benchmarks.invariants.states import StateSet
    from kinqp.control import InterpretedStep

MODE = "fix-orientation"


@functools.cache
def states(robot: str = "lbr_med14", mode: str = MODE, count: int = 32) -> StateSet:
    return States(arm(robot), Mode.parse(mode), 0).take(count)


@functools.cache
def interpreted() -> tuple[InterpretedStep, Answers]:
    step, recorder = recorded_step(arm("lbr_med14"), get_formulation("joint-space"), Mode.parse(MODE))
    return step, solve_all(step, recorder, get_solver("active-set"), states(), {})


def row() -> Row:
    return Row(formulation="joint-space", robot="lbr_med14", mode=MODE, solver="any")
