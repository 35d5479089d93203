"""The requirements scorecard as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ...metrics import REQUIREMENTS
from .style import WIDTH, figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from ..scorecard import Row

# Light enough to print text on, and told apart in grey as well.
_COLOURS: Final = {"pass": "#d7efe6", "fail": "#f3b8a8", "none": "#ffffff"}


def scorecard_figure(rows: Sequence[Row]) -> Figure | None:
    """Formulations against the ten requirements, one solver's; None without rows."""
    if not rows:
        return None
    made, ((axis,),) = figure(1, 1, 0.2 * len(rows) + 0.75, extra=0.1)
    axis.set_axis_off()
    text = [[row.formulation, f"{row.passed}/{row.measured}", *(mark.text for mark in row.marks)] for row in rows]
    colours = [["white", "white", *(_COLOURS[mark.kind] for mark in row.marks)] for row in rows]
    heads = ["formulation", "passed", *(f"{one.number}.\n{one.key.replace('_', chr(10))}" for one in REQUIREMENTS)]
    longest = max(len(row.formulation) for row in rows)
    first = min(0.32, 0.0085 * longest + 0.02) * 7.16 / WIDTH
    widths = [first, 0.055, *([(0.945 - first) / len(REQUIREMENTS)] * len(REQUIREMENTS))]
    table = axis.table(
        text, cellColours=colours, colLabels=heads, colWidths=widths, loc="upper center", cellLoc="center"
    )
    table.auto_set_font_size(False)
    table.set_fontsize(6)
    for (row, column), cell in table.get_celld().items():
        cell.set_linewidth(0.3)
        cell.set_height((2.0 if row == 0 else 1.0) / (len(rows) + 2.0))
        cell.get_text().set_fontsize(5.0 if row == 0 else 6.0)
        if column == 0:
            cell.get_text().set_horizontalalignment("left")
    return made
