"""Compiled steps: the same bits every time, bounded iterations, and the interpreted step's command."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...solvers import Status
from .answers import MEMORY, count_refused, inputs_of, judge_bad_input, judge_commands

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ...codegen import CompiledStep
    from ...control import InterpretedStep
    from .answers import Answers
    from .states import StateSet
    from .tally import Row

    Array = NDArray[np.float64]

PARITY: Final = 1e-9
#: Of a batch, how many ticks are called one by one too.
SINGLE: Final = 300
# A state is as good as its neighbours this far away [rad or m]: a tenth of a nanometre at the tool, and
# where the C code begins to take coefficients of rows for rounding.
BACKWARD: Final = 1e-10
_NEIGHBOURS: Final = 12
# Further apart than this no neighbour excuses anything.
_FAR: Final = 1e-3


def judge_compiled(
    row: Row, step: CompiledStep, states: StateSet, given: Mapping[str, ArrayLike], stop: Array
) -> tuple[Array, NDArray[np.intc]]:
    """Check a compiled step on all states; give its commands and status codes."""
    count = len(states.q)
    taken = {name: value for name, value in given.items() if name in step.inputs}
    signals = {name: getattr(states, name) for name in MEMORY if name in step.inputs}
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
    """NaN in a tick of a batch refuses that tick alone, with finite numbers.

    In `qdd_prev`, where it refuses the batch, none is put.
    """
    values = {"q": states.q.copy(), "v": states.v.copy(), "qd_prev": states.qd_prev.copy()}
    names = [name for name in values if name in ("q", "v") or name in step.inputs]
    change = {"qdd_prev": states.qdd_prev} if "qdd_prev" in step.inputs else {}

    def batch() -> Any:
        signals = {name: values[name] for name in names if name not in ("q", "v")}
        return step.batch(values["q"], values["v"], **signals, **change, **taken)

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
    steps: tuple[InterpretedStep, CompiledStep],
    states: StateSet,
    given: Mapping[str, ArrayLike],
    answers: Answers,
    compiled: tuple[Array, NDArray[np.intc]],
) -> NDArray[np.bool_]:
    """Compare compiled with interpreted commands, of the states that both have; give which are too far apart."""
    count = min(len(answers.qd), len(compiled[0]))
    qd, solved = compiled[0][:count], compiled[1][:count] == 0
    wanted, known = answers.qd[:count], answers.solved[:count]
    both = solved & known
    size = np.maximum(np.max(np.abs(wanted), axis=1, initial=0.0), 1.0)
    apart = np.where(both, np.max(np.abs(qd - wanted), axis=1) / size, 0.0)
    allowed = np.full(count, PARITY)
    # Where a state's neighbours have other commands, the state itself does not say which is right.
    for i in np.flatnonzero(~(apart <= PARITY)):
        allowed[i] = max(PARITY, moved(steps, states, int(i), given))
    row.notes["apart, no further than at states 1e-10 away"] = int(np.sum((apart > PARITY) & (apart <= allowed)))
    row.notes["solved by interpreted only"] = int(np.sum(known & ~solved))
    row.notes["solved by compiled only"] = int(np.sum(solved & ~known))
    row.check("parity", apart, allowed, states)
    row.check("apart", apart, _FAR, states)
    return np.asarray((apart > allowed) | (apart > _FAR))


def moved(
    steps: tuple[InterpretedStep, CompiledStep],
    states: StateSet,
    index: int,
    given: Mapping[str, ArrayLike],
) -> float:
    """How far either command moves when the joints are elsewhere by `BACKWARD`, relative as in parity."""
    rng = np.random.default_rng(index)
    both: tuple[InterpretedStep | CompiledStep, ...] = steps
    q, v = states.q[index], states.v[index]
    inputs = [inputs_of(step.inputs, states, index, given) for step in both]
    commands = [step(q, v, **taken).qd for step, taken in zip(both, inputs, strict=True)]
    most = 0.0
    for _ in range(_NEIGHBOURS):
        near = q + BACKWARD * rng.choice([-1.0, 1.0], q.size)
        for step, taken, command in zip(both, inputs, commands, strict=True):
            result = step(near, v, **taken)
            if result.status is Status.SOLVED:
                most = max(most, float(np.max(np.abs(result.qd - command))))
    return most / max(float(np.max(np.abs(commands[0]))), 1.0)
