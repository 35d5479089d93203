"""One colour for one name, in every figure of a report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

# Told apart by readers with any kind of colour vision, on white and on near-black (after Okabe and Ito, evened out in
# lightness).
COLOURS: Final = ("#2f7fd1", "#e2711d", "#1b9e77", "#c5468f", "#8a63d2", "#a6781b", "#3fa7c4", "#d1495b")
# A second and a third round through the colours is told from the first by its line.
DASHES: Final = ("solid", "dash", "dot")


def styles(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Colour and dash of each name, by its place in the list."""
    return {name: (COLOURS[i % len(COLOURS)], DASHES[i // len(COLOURS) % len(DASHES)]) for i, name in enumerate(names)}
