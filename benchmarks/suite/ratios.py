"""The speed of the generated tick beside DAQP and Pink: ratios against their targets, and where a tick spends its time.

Run by ``make perf``. How it measures: ours and the other take turns, pass by pass; a state's time is its smallest of
`PASSES` passes; of those come percentiles over the states. There are `REPEATS` repeats. In each, ours runs through all
states, DAQP through every `REPEATS`-th, other ones each time, and the medians over these states are divided; what is
shown is the median of these ratios, and their range. High percentiles are over all states, each by the minimum of its
repeat.
"""

from __future__ import annotations

import argparse
import os
import subprocess
from dataclasses import dataclass
from importlib.metadata import version
from time import perf_counter_ns
from typing import TYPE_CHECKING, Final

import daqp  # noqa: F401  # says at once what is missing
import numpy as np

from kinqp.benchmarks import conditions
from kinqp.codegen import compile_step
from kinqp.solvers.native import compiler
from measure.pink_ik import PinkStep, pink_solvers
from measure.problems import Problems, judge
from measure.states import MODE, ROBOT, States, arm, degenerate, near_limits, semicircle
from measure.table import Report, table
from measure.tick import PROFILE, QP, STAGES, WHOLE, TimedTick, compiler_flags

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinqp.codegen import CompiledStep

    Array = NDArray[np.float64]

FORMULATIONS: Final = ("cartesian-error", "joint-space")
REPEATS: Final = 20
PASSES: Final = 7
BATCH: Final = 100_000
MILLION: Final = 1_000_000
LIKE: Final = 500  # states a repeat when both are called from the interpreter
CALLS: Final = 100  # Python calls a repeat


@dataclass
class Measured:
    """Times of one formulation on one set of states, per state and per repeat's block [ns]."""

    formulation: str
    data: str
    blocks: list[slice]
    constrained: NDArray[np.bool_]
    whole: Array
    qp: Array
    solve: Array
    both: Array
    stages: Array
    iterations: NDArray[np.intc]
    failed: int
    daqp_failures: int

    def ratio(self, ours: Array, other: Array, *, constrained: bool) -> Array:
        """Ratio of the medians of each repeat's states."""
        picked = [self._of(block, constrained=constrained) for block in self.blocks]
        return np.array([np.median(ours[index]) / np.median(other[index]) for index in picked if index.size])

    def percentile(self, times: Array, share: float, *, constrained: bool) -> float:
        """Percentile over all states."""
        return float(np.percentile(times[self._of(slice(None), constrained=constrained)], share))

    def _of(self, block: slice, *, constrained: bool) -> NDArray[np.intp]:
        index = np.arange(len(self.whole))[block]
        return index[self.constrained[index]] if constrained else index


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--passes", type=int, default=PASSES, help="passes a repeat, of which a state's minimum counts")
    parser.add_argument("--states", type=int, default=20_000, help="random and degenerate states")
    parser.add_argument("--flags", default="", help="further compiler flags of the tick, e.g. --flags=-march=native")
    options = parser.parse_args()
    flags = options.flags.split()
    sets = [near_limits(options.states), semicircle(), degenerate(options.states)]
    print(_conditions(flags, sets, options.passes))
    report = Report()
    measured: list[Measured] = []
    like: list[tuple[str, ...]] = []
    degenerate_rows: list[tuple[str, ...]] = []
    for formulation in FORMULATIONS:
        for states in sets:
            problems = Problems(arm(), formulation, MODE, states)
            measured.append(measure(formulation, states, problems, options.passes, flags))
            if states is sets[0]:
                like.append(like_for_like(formulation, states, problems, options.passes, flags))
            if states is sets[2]:
                degenerate_rows.append(judged(formulation, states, problems, report))
        _relations(measured[-len(sets) :], report)
        _from_python(formulation, sets[0], report, flags)
    print("\nWhere a tick spends its time: medians [ns]; stages are fenced off, so their sum is above the tick")
    print(profile(measured))
    print("\nTimes [ns]; the QP and DAQP on the ticks that a bound holds back, the tick on all")
    print(times(measured))
    print("\nRandom states, ours called one by one from the interpreter, in turn with DAQP: medians [ns]")
    print(
        table(("formulation", "tick", "QP, constrained", "DAQP solve", "DAQP set-up + solve", "tick / DAQP both"), like)
    )
    print("\nDegenerate states against DAQP at tight tolerances and quadprog")
    print(
        table(
            ("formulation", "failed", "wrong", "most iterations", "DAQP, quadprog off alone"),
            degenerate_rows,
        )
    )
    print(f"\nTargets: {len(report.rows) - report.missed} met, {report.missed} missed")
    print(report)
    print(f"load average at the end: {_load()}")


def measure(formulation: str, states: States, problems: Problems, passes: int, flags: Sequence[str]) -> Measured:
    """Time the tick, its QP alone and DAQP on the same states, in turns."""
    whole, qp = (TimedTick(arm(), formulation, MODE, states, level, flags) for level in (WHOLE, QP))
    blocks = [slice(first, None, REPEATS) for first in range(REPEATS)]
    count = len(states.q)
    times = {name: np.full(count, np.inf) for name in ("whole", "qp")}
    for block in blocks:
        whole.reset()
        qp.reset()
        for _ in range(passes):
            whole.passes()
            problems.passes(block)
            qp.passes()
        times["whole"][block] = whole.whole()[block]
        times["qp"][block] = qp.qp()[block]
    staged = TimedTick(arm(), formulation, MODE, states, PROFILE, flags)
    for _ in range(passes):
        staged.passes()
    return Measured(
        formulation=formulation,
        data=states.name,
        blocks=blocks,
        constrained=whole.iterations > 0,
        whole=times["whole"],
        qp=times["qp"],
        solve=problems.solve.copy(),
        both=problems.both.copy(),
        stages=staged.stages(),
        iterations=whole.iterations.copy(),
        failed=int(np.sum(whole.status != 0)),
        daqp_failures=problems.failures,
    )


def like_for_like(
    formulation: str, states: States, problems: Problems, passes: int, flags: Sequence[str]
) -> tuple[str, ...]:
    """Time ours as DAQP's wheel is timed: one state at a time, with the interpreter's work in between."""
    whole, qp = (TimedTick(arm(), formulation, MODE, states, level, flags) for level in (WHOLE, QP))
    ratios, medians = [], []
    for repeat in range(REPEATS):
        block = slice(repeat * LIKE, (repeat + 1) * LIKE)
        problems.reset()
        for _ in range(passes):
            found = []
            for index in range(len(states.q))[block]:
                whole.one(index)
                found.append(problems.one(index)[:2])
                qp.one(index)
            if found:
                problems.keep(block, found)
        tick, both = whole.whole()[block], problems.both[block]
        held = whole.iterations[block] > 0
        if not held.any():
            continue
        ratios.append(np.median(tick) / np.median(both))
        columns = (tick, qp.qp()[block][held], problems.solve[block][held], both)
        medians.append([np.median(column) for column in columns])
    shown = np.median(medians, axis=0)
    return (formulation, *(f"{value:.0f}" for value in shown), f"{np.median(ratios):.3f}{_range(np.array(ratios))}")


def judged(formulation: str, states: States, problems: Problems, report: Report) -> tuple[str, ...]:
    """Judge the commands at degenerate states."""
    answers = compile_step(arm(), formulation, MODE).batch(states.q, states.v)
    verdict = judge(problems, answers.qd, answers.codes)
    most = int(answers.iterations.max())
    for what, value, limit in (
        ("failures", verdict.failed, 0),
        ("wrong answers", verdict.wrong, 0),
        ("most iterations", most, 10),
    ):
        report.below(f"{formulation}: {what}", states.name, (str(value), ""), value, limit)
    alone = ", ".join(map(str, verdict.reference_failures))
    return (formulation, str(verdict.failed), str(verdict.wrong), str(most), alone)


def _relations(sets: Sequence[Measured], report: Report) -> None:
    """Put the figures of one formulation against their targets."""
    name = sets[0].formulation
    for m in sets:
        qp = m.percentile(m.qp, 50, constrained=True)
        if name == "cartesian-error":
            r = m.ratio(m.qp, m.solve, constrained=True)
            figures = _pair(qp, m.percentile(m.solve, 50, constrained=True))
            report.below(f"{name}: QP p50 / DAQP solve", m.data, figures, _median(r), 1 / 3, _range(r))
            tail, theirs = (m.percentile(x, 99.9, constrained=True) for x in (m.qp, m.solve))
            report.below(f"{name}: QP p99.9 / DAQP solve", m.data, _pair(tail, theirs), tail / theirs, 1 / 2)
        r = m.ratio(m.qp, m.both, constrained=True)
        figures = _pair(qp, m.percentile(m.both, 50, constrained=True))
        share = 1 / 8 if name == "cartesian-error" else 1 / 3
        report.below(f"{name}: QP p50 / DAQP set-up + solve", m.data, figures, _median(r), share, _range(r))
    for m in sets:
        r = m.ratio(m.whole, m.both, constrained=False)
        p50, high = (m.percentile(m.whole, share, constrained=False) for share in (50, 99.9))
        figures = _pair(p50, m.percentile(m.both, 50, constrained=False))
        report.below(f"{name}: tick p50 / DAQP set-up + solve", m.data, figures, _median(r), 1 / 2, _range(r))
        report.below(f"{name}: tick p99.9 / its p50", m.data, _pair(high, p50), high / p50, 3.0)


def _from_python(formulation: str, states: States, report: Report, flags: Sequence[str]) -> None:
    """Time calls from Python: batch beside the C loop, single calls beside Pink."""
    step = compile_step(arm(), formulation, MODE)
    tick = TimedTick(arm(), formulation, MODE, states, WHOLE, flags)
    q, v = _repeated(states, BATCH)
    ratios, seconds = [], []
    for _ in range(REPEATS):
        c = tick.loop(q, v)
        python = _batch_time(step, q, v)
        ratios.append(python / c)
        seconds.append((python * 1e-9, c * 1e-9))
    r = np.array(ratios)
    mine, loop = np.median(seconds, axis=0)
    figures = (f"{mine * 1e9 / BATCH:.0f} ns", f"{loop * 1e9 / BATCH:.0f} ns")
    report.below(f"{formulation}: batch / C loop, per tick", states.name, figures, _median(r), 1.1, _range(r))
    q, v = _repeated(states, MILLION)
    million = np.array([_batch_time(step, q, v) * 1e-9 for _ in range(3)])
    report.below(f"{formulation}: batch of a million [s]", states.name, ("", ""), float(million.min()), 0.4)

    pink = PinkStep(arm())
    rng = np.random.default_rng(0)
    solver = min(pink_solvers(), key=lambda name: _median(_pink_times(pink, states, name, np.arange(20))))
    ratios, medians = [], []
    for _ in range(REPEATS):
        index = rng.integers(0, len(states.q), CALLS)
        theirs = _median(_pink_times(pink, states, solver, index))
        ours = _median(_step_times(step, states, index))
        ratios.append(ours / theirs)
        medians.append((ours, theirs))
    r = np.array(ratios)
    mine, theirs = np.median(medians, axis=0)
    figures = (f"{mine / 1e3:.1f} us", f"{theirs / 1e3:.0f} us")
    report.below(f"{formulation}: step(q, v) / pink ({solver})", states.name, figures, _median(r), 1 / 30, _range(r))


def _pink_times(pink: PinkStep, states: States, solver: str, index: NDArray[np.int64]) -> Array:
    return np.array([pink.time(states.q[i], states.v[i], solver) for i in index], dtype=float)


def _step_times(step: CompiledStep, states: States, index: NDArray[np.int64]) -> Array:
    found = []
    for i in index:
        q, v = states.q[i], states.v[i]
        start = perf_counter_ns()
        step(q, v)
        found.append(perf_counter_ns() - start)
    return np.array(found, dtype=float)


def _batch_time(step: CompiledStep, q: Array, v: Array) -> float:
    start = perf_counter_ns()
    step.batch(q, v)
    return float(perf_counter_ns() - start)


def _repeated(states: States, count: int) -> tuple[Array, Array]:
    index = np.arange(count) % len(states.q)
    return states.q[index], states.v[index]


def profile(measured: Sequence[Measured]) -> str:
    """Tabulate the stages: all ticks, and those that a bound holds back."""
    rows = []
    for m in measured:
        for kind, picked in (("all", np.ones_like(m.constrained)), ("constrained", m.constrained)):
            if picked.any():
                stages = [np.median(m.stages[picked, i]) for i in range(len(STAGES))]
                tick = np.median(m.whole[picked])
                rows.append((m.formulation, m.data, kind, *(f"{x:.0f}" for x in stages), f"{tick:.0f}"))
    return table(("formulation", "data", "ticks", *STAGES, "tick"), rows)


def times(measured: Sequence[Measured]) -> str:
    """Tabulate percentiles."""
    rows = []
    for m in measured:
        columns = [_percentiles(x[m.constrained]) for x in (m.qp, m.solve, m.both)]
        counts = f"{np.mean(m.constrained):.1%}", f"{m.iterations[m.constrained].mean():.2f} / {m.iterations.max()}"
        columns += [_percentiles(m.whole), _percentiles(m.both)]
        rows.append((m.formulation, m.data, *counts, *columns, f"{m.failed} / {m.daqp_failures}"))
    head = ("formulation", "data", "constrained", "iterations mean / max", "QP p50 / p99 / p99.9", "DAQP solve",
            "DAQP set-up + solve", "tick, all", "DAQP set-up + solve, all", "failed: ours / DAQP")  # fmt: skip
    return table(head, rows)


def _percentiles(values: Array) -> str:
    return " / ".join(f"{x:.0f}" for x in np.percentile(values, (50, 99, 99.9)))


def _conditions(flags: Sequence[str], sets: Sequence[States], passes: int) -> str:
    found = conditions()
    clock = TimedTick(arm(), FORMULATIONS[0], MODE, sets[0], WHOLE)
    lines = [
        f"{found['cpu']}, {found['cores']} cores, load average {_load()}; {found['system']}; {found['date']}",
        f"{_compiler()}: {' '.join((compiler_flags(), *flags))}",
        f"Python {found['python']}, numpy {found['numpy']}, daqp {version('daqp')}, pin-pink {version('pin-pink')}",
        f"{ROBOT}, {MODE}; {', '.join(f'{len(s.q)} {s.name}' for s in sets)} states",
        f"{REPEATS} interleaved repeats, minimum of {passes} passes per state",
        f"clock: {clock.cost * clock.unit:.0f} ns, taken off our times; "
        f"clock_gettime: {clock.gettime_cost():.0f} ns, inside the times that DAQP reports",
    ]
    return "\n".join(lines)


def _compiler() -> str:
    answer = subprocess.run([*compiler(), "--version"], capture_output=True, text=True, check=True)
    return answer.stdout.splitlines()[0]


def _load() -> str:
    return " ".join(f"{x:.1f}" for x in os.getloadavg())


def _median(values: Array) -> float:
    return float(np.median(values))


def _range(ratios: Array) -> str:
    return f" ({ratios.min():.3f}-{ratios.max():.3f})"


def _pair(ours: float, other: float) -> tuple[str, str]:
    return f"{ours:.0f} ns", f"{other:.0f} ns"


if __name__ == "__main__":
    main()
