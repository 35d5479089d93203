"""Compiled steps: the same bits every time, bounded iterations, and the interpreted step's command."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...solvers import Status, get_solver
from .answers import count_refused, inputs_of, judge_bad_input, judge_commands

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ...codegen import CompiledStep
    from ...control import InterpretedStep
    from ...solvers import QP, Solution
    from .answers import Answers
    from .states import StateSet
    from .tally import Row

    Array = NDArray[np.float64]

PARITY: Final = 1e-9
#: Of a batch, how many ticks are called one by one too.
SINGLE: Final = 300
# Rounding of the data that conditioning amplifies; and the most that it excuses.
_ROUNDING: Final = 64.0 * float(np.finfo(float).eps)
_MOST_EXCUSED: Final = 1e-2
# Singular values below this share of the largest are rounding.
_NOTHING: Final = 1e-15
# Multipliers above this share of the largest make a row active.
_ACTIVE: Final = 1e-12


def judge_compiled(
    row: Row, step: CompiledStep, states: StateSet, given: Mapping[str, ArrayLike], stop: Array
) -> tuple[Array, NDArray[np.intc]]:
    """Check a compiled step on all states; give its commands and status codes."""
    count = len(states.q)
    taken = {name: value for name, value in given.items() if name in step.inputs}
    signals = {"qd_prev": states.qd_prev} if "qd_prev" in step.inputs else {}
    first = step.batch(states.q, states.v, **signals, **taken)
    again = step.batch(states.q, states.v, **signals, **taken)
    fields = ("qd", "eps", "codes", "iterations", "sides")
    row.check("repeat", sum(_differs(getattr(first, f), getattr(again, f)) for f in fields), 0.0, states)
    row.check("iterations", first.iterations, float(step.code.max_iterations), states)
    singles = []
    for i in range(min(SINGLE, count)):
        one = step(states.q[i], states.v[i], **inputs_of(step.inputs, states, i, given))
        same = one.qd.tobytes() == first.qd[i].tobytes() and one.eps.tobytes() == first.eps[i].tobytes()
        same = same and one.status is first.status[i] if count <= SINGLE else same
        singles.append(not (same and one.iterations == first.iterations[i]))
    row.check("batch", singles, 0.0, states)
    judge_commands(row, states, first.qd, first.eps, first.codes == 0, stop=stop)
    count_refused(row, list(first.status))
    judge_bad_input(row, step, states, given)
    _judge_bad_batch(row, step, states.first(min(64, count)), taken)
    return first.qd, first.codes


def _differs(one: NDArray[Any], two: NDArray[Any]) -> NDArray[np.bool_]:
    """Which rows differ in a bit."""
    a, b = (np.ascontiguousarray(x.reshape(len(x), -1)).view(np.uint8) for x in (one, two))
    return np.asarray((a != b).any(axis=1)) if a.size else np.zeros(len(one), dtype=bool)


def _judge_bad_batch(row: Row, step: CompiledStep, states: StateSet, taken: Mapping[str, ArrayLike]) -> None:
    """NaN in a tick of a batch refuses that tick alone, with finite numbers."""
    values = {"q": states.q.copy(), "v": states.v.copy(), "qd_prev": states.qd_prev.copy()}
    names = [name for name in values if name in ("q", "v") or name in step.inputs]

    def batch() -> Any:
        signals = {name: values[name] for name in names if name not in ("q", "v")}
        return step.batch(values["q"], values["v"], **signals, **taken)

    clean = batch()
    wrong = np.zeros(len(states.q), dtype=int)
    spoilt = np.arange(0, len(states.q), 3)
    for number, i in enumerate(spoilt):
        bad = values[names[number % len(names)]]
        bad[i, number % bad.shape[1]] = (np.nan, np.inf)[number % 2]
    result = batch()
    kept = np.setdiff1d(np.arange(len(states.q)), spoilt)
    wrong[kept] += _differs(result.qd[kept], clean.qd[kept])
    wrong[spoilt] += (result.codes[spoilt] == 0) | ~np.isfinite(result.qd[spoilt]).all(axis=1)
    row.check("nan", wrong, 0.0, states)


def judge_parity(
    row: Row,
    step: InterpretedStep,
    states: StateSet,
    given: Mapping[str, ArrayLike],
    answers: Answers,
    compiled: tuple[Array, NDArray[np.intc]],
) -> None:
    """Compare compiled with interpreted commands, of the states that both have."""
    count = min(len(answers.qd), len(compiled[0]))
    qd, solved = compiled[0][:count], compiled[1][:count] == 0
    wanted, known = answers.qd[:count], answers.solved[:count]
    both = solved & known
    size = np.maximum(np.max(np.abs(wanted), axis=1, initial=0.0), 1.0)
    apart = np.where(both, np.max(np.abs(qd - wanted), axis=1) / size, 0.0)
    allowed = np.full(count, PARITY)
    # One by one, because conditioning is only worth working out where it is called upon.
    for i in np.flatnonzero(~(apart <= PARITY)):
        allowed[i] = max(PARITY, excused(step, states, int(i), given))
    row.notes["apart, by conditioning"] = int(np.sum((apart > PARITY) & (apart <= allowed)))
    row.notes["solved by interpreted only"] = int(np.sum(known & ~solved))
    row.notes["solved by compiled only"] = int(np.sum(solved & ~known))
    row.check("parity", apart, allowed, states)


def excused(step: InterpretedStep, states: StateSet, index: int, given: Mapping[str, ArrayLike]) -> float:
    """How far rounding of the data alone may move the command, by `conditioning`."""
    inputs = inputs_of(step.inputs, states, index, given)
    instance = step.evaluate(states.q[index], states.v[index], **inputs)
    solution = get_solver("active-set").solve(instance.qp)
    if solution.status is not Status.SOLVED:
        return PARITY
    return min(_ROUNDING * conditioning(instance.qp, solution), _MOST_EXCUSED)


def conditioning(qp: QP, solution: Solution) -> float:
    """How much rounding of the data is amplified on its way into the answer.

    The larger one of two numbers: the condition of the active rows, each scaled to length one (nearly dependent rows
    leave the point along their weak direction to rounding), and that of the Hessian within their null space. Both count
    singular values down to where a row or a curvature is nothing but rounding.
    """
    multipliers = np.concatenate((solution.y, solution.z, solution.z_box))
    active = np.abs(multipliers) > _ACTIVE * max(float(np.max(np.abs(multipliers), initial=0.0)), 1e-300)
    active[: qp.m_eq] = True
    rows = qp.stacked[active]
    rows = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
    _, sigma, Vt = np.linalg.svd(rows, full_matrices=True)
    rank = int(np.sum(sigma > _NOTHING * np.max(sigma, initial=0.0)))
    weakest = float(sigma[0] / sigma[rank - 1]) if rank else 1.0
    left = Vt[rank:]
    curvature = np.linalg.eigvalsh(left @ qp.H @ left.T) if len(left) else np.ones(1)
    least = max(float(curvature[0]), _NOTHING * max(float(curvature[-1]), 1e-300))
    return max(weakest, float(curvature[-1]) / least)
