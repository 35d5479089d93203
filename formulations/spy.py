"""The pattern of a formulation's KKT matrix as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from .lowering import lower

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..robots import Robot
    from .base import Formulation
    from .lowering import Lowered
    from .modes import Mode

    Pattern = NDArray[np.int8]

CONSTANT: Final = 1
CHANGING: Final = 2
_SUFFIXES: Final = (".png", ".svg")
# Inches per row, and the least side of the picture.
_CELL: Final = 0.16
_LEAST: Final = 3.0


class PlotError(ValueError):
    """A picture can't be written as asked; the message names the path."""


def kkt_pattern(lowered: Lowered) -> tuple[Pattern, list[tuple[str, int]]]:
    """Give the pattern of [[H, A', C', E'], [A, 0, 0, 0], [C, 0, 0, 0], [E, 0, 0, 0]], E picking bounded variables.

    Returns
    -------
    pattern : ndarray of int8, shape (N, N)
        0: zero whatever the inputs, 1: a constant, 2: changes with the inputs.
    groups : list of (str, int)
        Names and sizes of consecutive rows: the variables, then the named rows.
    """
    # Constant entries come out the same whatever goes in.
    anything = lowered.function.call([np.full(given.size, 0.5) for given in lowered.inputs])
    values = dict(zip(lowered.function.name_out(), anything, strict=True))

    def pattern(name: str) -> Pattern:
        numbers, fixed = np.array(values[name], dtype=float), lowered.constant[name]
        return np.where(fixed, np.where(numbers != 0.0, CONSTANT, 0), CHANGING).astype(np.int8)

    names = lowered.rows
    bounded = [j for j, name in enumerate(names.box) if name]
    box = np.eye(lowered.n, dtype=np.int8)[bounded] * np.int8(CONSTANT)
    rows = np.vstack((pattern("A"), pattern("C"), box))
    zero = np.zeros((len(rows), len(rows)), dtype=np.int8)
    whole: Pattern = np.block([[pattern("H"), rows.T], [rows, zero]])
    labels = [name for name, where in lowered.variables.items() for _ in range(where.stop - where.start)]
    named = (*names.equalities, *names.inequalities, *(names.box[j] for j in bounded))
    labels += [name.lstrip("-").rpartition("[")[0] for name in named]
    groups: list[tuple[str, int]] = []
    for label in labels:
        if groups and groups[-1][0] == label:
            groups[-1] = (label, groups[-1][1] + 1)
        else:
            groups.append((label, 1))
    return whole, groups


def spy(formulation: Formulation, robot: Robot, mode: Mode, path: str | Path) -> Path:
    """Draw the pattern; see `Formulation.spy`."""
    from matplotlib import rc_context
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    file = Path(path)
    if file.suffix not in _SUFFIXES:
        raise PlotError(f"path: expected a file name that ends in {' or '.join(_SUFFIXES)}, got {file}")
    pattern, groups = kkt_pattern(lower(formulation, robot, mode))
    size = max(_LEAST, _CELL * len(pattern))
    # Without a fixed salt and with a date, the same formulation would give another SVG each time.
    with rc_context({"svg.hashsalt": "kinqp"}):
        figure = Figure(figsize=(size + 1.5, size + 1.5), layout="constrained")
        axes = figure.add_subplot()
        colours = ("white", "tab:gray", "tab:blue")
        axes.imshow(pattern, cmap=ListedColormap(colours), vmin=0, vmax=CHANGING, interpolation="nearest")
        ends = np.cumsum([count for _, count in groups])
        middles = ends - np.array([count for _, count in groups]) / 2 - 0.5
        for end in ends[:-1]:
            axes.axhline(end - 0.5, color="black", linewidth=0.5)
            axes.axvline(end - 0.5, color="black", linewidth=0.5)
        axes.set_xticks(middles, [name for name, _ in groups], rotation=90)
        axes.set_yticks(middles, [name for name, _ in groups])
        axes.tick_params(length=0)
        axes.set_title(f"{formulation.name} on {robot.name}, {mode}: KKT matrix", fontsize="medium")
        handles = [Patch(color=colours[CONSTANT], label="constant"), Patch(color=colours[CHANGING], label="changes")]
        axes.legend(handles=handles, loc="lower right", fontsize="small")
        figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None)
    return file
