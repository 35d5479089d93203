"""Plain tables, targets and what became of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass
class Report:
    """Rows of figures, each against its target."""

    rows: list[tuple[str, ...]] = field(default_factory=list)

    def below(
        self, what: str, data: str, figures: tuple[str, str], value: float, target: float, spread: str = ""
    ) -> None:
        """Add a figure that should be at most `target`; ``figures``: ours and the other's, as text."""
        verdict = "met" if value <= target else "MISSED"
        self.rows.append((what, data, *figures, f"{value:.3f}{spread}", f"{target:.3f}", verdict))

    def __str__(self) -> str:
        head = ("figure", "data", "ours", "other", "value", "at most", "")
        return table(head, self.rows)

    @property
    def missed(self) -> int:
        """How many targets were missed."""
        return sum(row[-1] == "MISSED" for row in self.rows)


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Align columns of text."""
    widths = [max(len(row[i]) for row in (head, *rows)) for i in range(len(head))]
    rule = tuple("-" * width for width in widths)
    return "\n".join(
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |"
        for row in (head, rule, *rows)
    )


def median(values: Array) -> float:
    """Return the median as a number."""
    return float(np.median(values))


def spread(ratios: Array) -> str:
    """Write the range of ratios, to stand behind their median."""
    return f" ({ratios.min():.3f}-{ratios.max():.3f})"
