"""Rows as Markdown: what held, what was refused, what was broken."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import TYPE_CHECKING

from .tally import INVARIANTS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from .tally import Row


def to_markdown(rows: Sequence[Row]) -> str:
    """Write the table per formulation and solver, then every violation, then the cells that can't be."""
    run = [row for row in rows if not row.skipped]
    parts = [_summary(run), _worst(run), _violations(run), _notes(run), _skipped(rows)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _summary(rows: Sequence[Row]) -> str:
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row.formulation, row.solver].append(row)
    body = []
    for (formulation, solver), group in groups.items():
        states = sum(row.states for row in group)
        refused = sum((Counter(row.refused) for row in group), Counter[str]())
        share = 100.0 * refused.total() / max(states, 1)
        by = ", ".join(f"{name} {count}" for name, count in refused.most_common())
        broken = sum((Counter({n: v.count for n, v in row.violations.items()}) for row in group), Counter[str]())
        told = ", ".join(f"{name} {count}" for name, count in broken.most_common()) or "none"
        body.append(
            (formulation, solver, len(group), states, f"{refused.total()} ({share:.2g} %)", by,
             sum(row.wrong_solved for row in group), told)
        )  # fmt: skip
    head = ("formulation", "solver", "cells", "states", "refused", "by status", "wrong solved", "violations")
    return "## Formulation by solver\n\n" + table(head, body)


def _worst(rows: Sequence[Row]) -> str:
    """The worst figure of every invariant and solver, whether allowed or not."""
    solvers = sorted({row.solver for row in rows})
    body = []
    for name, meaning in INVARIANTS.items():
        figures = []
        for solver in solvers:
            met = [row.checked[name].worst for row in rows if row.solver == solver and name in row.checked]
            figures.append(f"{max(met):.1e}" if met else "")
        if any(figures):
            body.append((name, meaning, *figures))
    return "## Worst figures\n\n" + table(("invariant", "figure", *solvers), body)


def _violations(rows: Sequence[Row]) -> str:
    body = [
        (row.formulation, row.robot, row.mode, row.solver, name, one.count, f"{one.worst:.1e}", f"{one.allowed:.1e}",
         f"{one.index} ({one.kind})")
        for row in rows
        for name, one in row.violations.items()
    ]  # fmt: skip
    if not body:
        return "## Violations\n\nNone."
    head = ("formulation", "robot", "mode", "solver", "invariant", "states", "worst", "allowed", "worst at state")
    return "## Violations\n\n" + table(head, body)


def _notes(rows: Sequence[Row]) -> str:
    groups: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for row in rows:
        groups[row.formulation, row.solver].update({name: count for name, count in row.notes.items() if count})
    body = [(*key, name, count) for key, notes in groups.items() for name, count in notes.items()]
    return "## Counted, not wrong\n\n" + table(("formulation", "solver", "what", "states"), body) if body else ""


def _skipped(rows: Sequence[Row]) -> str:
    groups: dict[tuple[str, str], dict[str, None]] = defaultdict(dict)
    for row in rows:
        if row.skipped:
            groups[row.formulation, row.skipped][row.solver] = None
    body = [(formulation, ", ".join(solvers), why) for (formulation, why), solvers in groups.items()]
    return "## Cells that can't be\n\n" + table(("formulation", "solver", "why"), body) if body else ""


def table(head: Sequence[str], body: Iterable[Sequence[object]]) -> str:
    """Write a Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in body]
    return "\n".join(lines)
