"""The whole tick from Python: compiled, one by one and in a batch, and interpreted."""

import itertools

import numpy as np
import pytest

from kinqp.codegen import compile_step
from kinqp.control import make_step
from measure.states import MODE, arm, near_limits

ROUNDS = 200
BATCH = 10_000
FORMULATIONS = ["cartesian-error", "joint-space"]


@pytest.mark.parametrize("make", [compile_step, make_step], ids=["compiled", "interpreted"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_step(benchmark, formulation, make):
    states = near_limits(ROUNDS)
    step = make(arm(), formulation, MODE)
    upcoming = itertools.cycle(zip(states.q, states.v, strict=True))
    results = []
    benchmark.group = f"step: {formulation}"
    benchmark.pedantic(
        lambda q, v: results.append(step(q, v)),
        setup=lambda: (next(upcoming), {}),
        rounds=ROUNDS,
        warmup_rounds=5,
    )
    _say(benchmark, [result.iterations for result in results[-ROUNDS:]])


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_batch(benchmark, formulation):
    states = near_limits(BATCH)
    step = compile_step(arm(), formulation, MODE)
    benchmark.group = f"batch of {BATCH}"
    result = benchmark.pedantic(step.batch, args=(states.q, states.v), rounds=20, warmup_rounds=2)
    _say(benchmark, result.iterations)
    benchmark.extra_info["per tick, best [ns]"] = 1e9 * benchmark.stats.stats.min / BATCH


def _say(benchmark, iterations):
    benchmark.extra_info |= {"iterations mean": float(np.mean(iterations)), "iterations max": int(np.max(iterations))}
