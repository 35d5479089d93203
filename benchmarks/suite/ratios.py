"""The speed of the generated tick beside DAQP and Pink: ratios against their targets, and where a tick spends its time.

Run by ``make perf``. How it measures: ours and the other take turns, pass by pass; a state's time is its smallest of
`PASSES` passes; of those come percentiles over the states. There are `REPEATS` repeats. In each, ours runs through all
states, DAQP through every `REPEATS`-th, other ones each time, and the medians over these states are divided; what is
shown is the median of these ratios, and their range. High percentiles are over all states, each by the minimum of its
repeat.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

import daqp  # noqa: F401  # says at once what is missing
import numpy as np

from kinqp.codegen import compile_step
from measure.comparison import FORMULATIONS, Measured, like_for_like, measure
from measure.from_python import from_python
from measure.machine import load_average, machine
from measure.problems import Problems, judge
from measure.states import MODE, States, arm, degenerate, near_limits, semicircle
from measure.table import Report, median, spread, table
from measure.tick import STAGES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PASSES: Final = 7


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--passes", type=int, default=PASSES, help="passes a repeat, of which a state's minimum counts")
    parser.add_argument("--states", type=int, default=20_000, help="random and degenerate states")
    parser.add_argument("--flags", default="", help="further compiler flags of the tick, e.g. --flags=-march=native")
    options = parser.parse_args()
    flags = options.flags.split()
    sets = [near_limits(options.states), semicircle(), degenerate(options.states)]
    print(machine(flags, sets, options.passes))
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
        from_python(formulation, sets[0], report, flags)
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
    print(f"load average at the end: {load_average()}")


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
            report.below(f"{name}: QP p50 / DAQP solve", m.data, figures, median(r), 1 / 3, spread(r))
            tail, theirs = (m.percentile(x, 99.9, constrained=True) for x in (m.qp, m.solve))
            report.below(f"{name}: QP p99.9 / DAQP solve", m.data, _pair(tail, theirs), tail / theirs, 1 / 2)
        r = m.ratio(m.qp, m.both, constrained=True)
        figures = _pair(qp, m.percentile(m.both, 50, constrained=True))
        share = 1 / 8 if name == "cartesian-error" else 1 / 3
        report.below(f"{name}: QP p50 / DAQP set-up + solve", m.data, figures, median(r), share, spread(r))
    for m in sets:
        r = m.ratio(m.whole, m.both, constrained=False)
        p50, high = (m.percentile(m.whole, share, constrained=False) for share in (50, 99.9))
        figures = _pair(p50, m.percentile(m.both, 50, constrained=False))
        report.below(f"{name}: tick p50 / DAQP set-up + solve", m.data, figures, median(r), 1 / 2, spread(r))
        report.below(f"{name}: tick p99.9 / its p50", m.data, _pair(high, p50), high / p50, 3.0)


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


def _pair(ours: float, other: float) -> tuple[str, str]:
    return f"{ours:.0f} ns", f"{other:.0f} ns"


if __name__ == "__main__":
    main()
