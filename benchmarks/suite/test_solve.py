"""Each formulation's QPs by each of the library's solvers, per solve through the common interface."""

import itertools
from functools import cache

import numpy as np
import pytest

from kinqp.control import make_step
from kinqp.formulations import available_formulations, get_formulation, levels_of
from kinqp.solvers import QP, available_solvers, get_solver
from measure.states import MODE, arm, near_limits

ROUNDS = 200
# How fast the arm moved before, for formulations that ask: shares of its joints' limits, at random.
MOVING = 0.2


def single_level():
    """Formulations that are one QP; a hierarchy is several, of which no one is the tick."""
    return [name for name in available_formulations() if len(levels_of(get_formulation(name))) == 1]


@cache
def problems(formulation: str) -> tuple[QP, ...]:
    states = near_limits(ROUNDS)
    step = make_step(arm(), formulation, MODE)
    commands = np.random.default_rng(0).uniform(-MOVING, MOVING, states.q.shape) * arm().qd_max
    return tuple(
        step.evaluate(q, v, **({"qd_prev": qd_prev} if "qd_prev" in step.inputs else {})).qp
        for q, v, qd_prev in zip(states.q, states.v, commands, strict=True)
    )


@pytest.mark.parametrize("solver", available_solvers())
@pytest.mark.parametrize("formulation", single_level())
def test_solve(benchmark, formulation, solver):
    backend = get_solver(solver)
    upcoming = itertools.cycle(problems(formulation))
    solutions = []
    benchmark.group = f"solve: {formulation}"
    benchmark.pedantic(
        lambda qp: solutions.append(backend.solve(qp)),
        setup=lambda: ((next(upcoming),), {}),
        rounds=ROUNDS,
        warmup_rounds=5,
    )
    solutions = solutions[-ROUNDS:]
    iterations = [solution.iterations for solution in solutions]
    if None not in iterations:
        benchmark.extra_info |= {"iterations mean": float(np.mean(iterations)), "iterations max": max(iterations)}
    benchmark.extra_info |= {
        "solved": sum(solution.solved for solution in solutions),
        "backend's own time, median [us]": 1e6 * float(np.median([s.setup_time + s.solve_time for s in solutions])),
    }
