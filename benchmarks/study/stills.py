"""Pictures of the arm for a paper: where it was, at even times, with each algorithm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure

from ..report.paper.style import WIDTH
from .motion_figures import column_title
from .panels import ALGORITHM_COLOURS, GREY, LIMIT_COLOUR
from .pattern import at_limit
from .skeleton import Skeleton

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .findings import Findings

    Array = NDArray[np.float64]

# How many postures are drawn, the first palest.
_POSTURES: Final = 6
_TRACE_POINTS: Final = 600


def arm_figure(found: Findings) -> Figure:
    """Draw the arm's postures at even times, the wanted path and the tool's trace, a panel for each algorithm."""
    study, settings = found.study, found.study.settings
    made = Figure(figsize=(WIDTH, 3.1))
    skeleton = Skeleton(next(iter(study.runs.values())).robot)
    corner, joint = skeleton.corner(settings.elbow), settings.elbow
    last = max(float(run.t[-1]) for run in study.runs.values())
    corners = [found.path]
    axes: list[Any] = []
    for number, (letter, run) in enumerate(study.runs.items()):
        axis: Any = made.add_subplot(1, len(study.runs), number + 1, projection="3d")
        axes.append(axis)
        on = at_limit(run, joint, settings.q_min[joint], settings.q_max[joint])
        still = found.still[letter]
        axis.plot(*found.path.T, color=GREY, linestyle="--", linewidth=0.8, label="wanted path")
        _trace(axis, run.position, on, letter)
        # The same instants for all: an arm that stands still is where it was.
        times = np.linspace(0.0, last, _POSTURES + 1)[:-1]
        for place, time in enumerate(times[times <= run.t[-1]]):
            tick = int(np.argmin(np.abs(run.t - time)))
            points, faint = skeleton(run.q[tick]), 0.2 + 0.6 * place / (_POSTURES - 1)
            axis.plot(*points.T, color="#3b4650", linewidth=2.4, alpha=faint, solid_capstyle="round", marker="o",
                      markersize=2.5)  # fmt: skip
            if on[tick]:
                axis.plot(*points[corner][:, None], "o", color=LIMIT_COLOUR, markersize=5)
            corners.append(points)
        held = float(np.count_nonzero(still) * run.dt)
        axis.set_title(f"{column_title(letter, settings)}\n{run.t[-1]:.1f} s, still for {held:.1f} s", loc="center")
    _frame(axes, np.concatenate(corners))
    # The layout engines leave no room for a title in three dimensions.
    made.subplots_adjust(left=0.02, right=0.97, bottom=0.14, top=0.88, wspace=0.12)
    handles = {label: handle for axis in axes for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    made.legend(list(handles.values()), list(handles), loc="lower center", ncols=len(handles))
    return made


def _trace(axis: Any, position: Array, on: NDArray[np.bool_], letter: str) -> None:
    at = np.unique(np.linspace(0, len(position) - 1, _TRACE_POINTS).astype(int))
    for name, shown, look in (
        (f"tool, {letter}", ~on[at], ALGORITHM_COLOURS[letter]),
        ("elbow at its limit", on[at], LIMIT_COLOUR),
    ):
        x, y, z = np.where(shown[:, None], position[at], np.nan).T
        axis.plot(x, y, z, color=look, linewidth=1.6, label=name)


def _frame(axes: list[Any], points: Array) -> None:
    """Show the same box in all, to scale."""
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = 0.0
    for axis in axes:
        axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axis.set_box_aspect(high - low)
        axis.view_init(elev=18, azim=35)
        axis.tick_params(labelsize=5, pad=-2)
        axis.set_xlabel("x [m]", labelpad=-6)
        axis.set_ylabel("y [m]", labelpad=-6)
        axis.set_zlabel("z [m]", labelpad=-6)
        axis.locator_params(nbins=4)
