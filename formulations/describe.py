"""A declaration as Markdown: the problem in LaTeX, its dimensions, its rows by name, its run-time inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..robots.text import in_markdown, one_line
from .hierarchy import Hierarchy
from .latex import Notation
from .lowering import lower

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..robots import Robot
    from .base import Formulation
    from .lowering import Lowered
    from .modes import Mode
    from .tick_inputs import Input

_MANY: Final = 8


def describe(formulation: Formulation, robot: Robot, mode: Mode) -> str:
    """Write a formulation on a robot in a mode as Markdown; see `Formulation.describe`."""
    title = "# `{}` on `{}`, mode `{}`".format(*map(in_markdown, (formulation.name, robot.name, str(mode))))
    if not isinstance(formulation, Hierarchy):
        return "\n\n".join([title, *_sections(formulation, robot, mode, "##")]) + "\n"
    names = " > ".join(in_markdown(level.name) for level in formulation.levels)
    parts = [title, _summary(formulation), f"{len(formulation.levels)} QPs, solved in order: {names}."]
    for level in formulation.levels:
        parts += [f"## Level `{in_markdown(level.name)}`", *_sections(level, robot, mode, "###")]
    return "\n\n".join(part for part in parts if part) + "\n"


def _summary(formulation: Formulation) -> str:
    return (type(formulation).__doc__ or "").strip().partition("\n\n")[0].replace("\n", " ")


def _sections(formulation: Formulation, robot: Robot, mode: Mode, heading: str) -> list[str]:
    """One QP: what it is about, the problem, and its tables under headings of this depth."""
    lowered = lower(formulation, robot, mode)
    notation = Notation(lowered)
    problem = ["```math", *_problem(lowered, notation), "```"]
    summary = _summary(formulation)
    legend = _table(("symbol", "stands for", "shape", "entries"), notation.legend)
    return [
        *([summary] if summary else []),
        "\n".join(problem),
        *([legend] if notation.legend else []),
        f"{heading} Dimensions",
        _table(("what", "count"), _dimensions(lowered)),
        f"{heading} Rows",
        _table(("name", "kind", "count", "where"), _rows(lowered)) if lowered.program.rows else "None.",
        f"{heading} Run-time inputs",
        _table(("name", "size", "unit", "default"), [_input(given) for given in lowered.inputs]),
    ]


def _problem(lowered: Lowered, notation: Notation) -> list[str]:
    program = lowered.program
    terms = [notation.term(term) for term in program.terms] + [notation.cost(cost) for cost in program.costs]
    over = r",\,".join(notation.variable(name) for name in program.variables)
    lines = [rf"\min_{{{over}}}\quad & {' + '.join(terms) or '0'}"]
    for index, rows in enumerate(program.rows):
        start = r"\text{s.t.}\quad & " if index == 0 else "& "
        lines.append(rf"{start}{notation.rows(rows)} && \text{{{notation.text(rows.name)}}}")
    lines.append(rf"& \text{{command}} = {notation.command()}")
    return [r"\begin{aligned}", *(line + r" \\" for line in lines[:-1]), lines[-1], r"\end{aligned}"]


def _dimensions(lowered: Lowered) -> list[tuple[str, ...]]:
    sizes = ", ".join(f"{name} {symbol.size1()}" for name, symbol in lowered.program.variables.items())
    rows = lowered.rows
    return [
        ("variables", f"{lowered.n} ({sizes})"),
        ("equalities", str(len(rows.equalities))),
        ("two-sided rows", str(len(rows.inequalities))),
        ("bounded variables", str(sum(bool(name) for name in rows.box))),
        ("joints", str(lowered.robot.nv)),
        ("guided rows, locked rows", f"{lowered.mode.m_free}, {lowered.mode.m_fixed}"),
    ]


def _rows(lowered: Lowered) -> list[tuple[str, ...]]:
    table: list[tuple[str, ...]] = []
    names = lowered.rows
    for rows in lowered.program.rows:
        for kind, matrix, labels in (
            ("equality", "A", names.equalities),
            ("two-sided", "C", names.inequalities),
            ("bound", "x", names.box),
        ):
            places = [i for i, label in enumerate(labels) if label.lstrip("-").rpartition("[")[0] == rows.name]
            if places:
                table.append((rows.name, kind, str(len(places)), f"{matrix}[{_ranges(places)}]"))
    return table


def _ranges(places: Sequence[int]) -> str:
    """Write indices as 0-2, 5."""
    groups: list[list[int]] = []
    for place in places:
        if groups and place == groups[-1][-1] + 1:
            groups[-1].append(place)
        else:
            groups.append([place])
    return ", ".join(str(g[0]) if len(g) == 1 else f"{g[0]}-{g[-1]}" for g in groups)


def _input(given: Input) -> tuple[str, ...]:
    if given.default is None:
        default = "to be given at every tick"
    elif given.size and np.all(given.default == given.default[0]):
        default = f"{given.default[0]:g}"
    else:
        shown = ", ".join(f"{value:.4g}" for value in given.default[:_MANY])
        default = shown + (", ..." if given.size > _MANY else "") if given.size else "-"
    return (f"`{given.name}`", str(given.size), given.unit, default)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(one_line(cell).replace("|", r"\|") for cell in line) + " |" for line in lines)
