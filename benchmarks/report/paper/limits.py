"""What happens at singularities and at joint limits (thesis, figure 4.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..downsample import extremes
from ..envelope import envelope, unit_of
from ..series import acceleration_share, positions, vectors
from .style import BUCKETS, DASHES, figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    import polars as pl
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ...scenarios import Scenario
    from .style import Series

    Array = NDArray[np.float64]

_LINES: Final = {"viable": ("-", "admissible"), "thesis": (":", "admissible (thesis, eq. 4.11)")}
_MOST_JOINTS: Final = 3


def singular_figure(series: Sequence[Series], scenario: Scenario) -> Figure | None:
    """Smallest singular value, joint accelerations and the share of the pull followed; None for states one by one."""
    runs = _closed_loops(series, scenario)
    if not runs:
        return None
    made, axes = figure(3, 1, 1.3, sharex="all")
    for place, (one, ticks, acceleration) in enumerate(runs):
        curves = (ticks["sigma_min"].to_numpy(), acceleration, ticks["task_scale"].to_numpy())
        for (axis,), values in zip(axes, curves, strict=True):
            at = extremes(values, BUCKETS)
            t = positions(ticks, scenario)[at] * scenario.dt
            axis.plot(
                t,
                values[at],
                color=one.colour,
                linestyle=DASHES[one.dash],
                label=one.case.cell.formulation,
                linewidth=_nested(place, len(runs)),
            )
    for (axis,), label in zip(
        axes,
        ("smallest singular\nvalue", "largest joint accel.\nover its limit", "share of the\npull followed"),
        strict=True,
    ):
        axis.set_ylabel(label)
        axis.set_ylim(bottom=min(0.0, axis.get_ylim()[0]))
    axes[1][0].axhline(1.0, color="0.3", linewidth=0.7, linestyle="--")
    axes[-1][0].set_xlabel("time [s]")
    _legend(made, axes[0][0])
    return made


def phase_figure(series: Sequence[Series], scenario: Scenario) -> Figure | None:
    """Velocity over position of the watched joints, with the admissible area; None where there is nothing to watch."""
    runs = _closed_loops(series, scenario)
    joints = scenario.watched_joints[:_MOST_JOINTS]
    if not runs or not joints:
        return None
    made, axes = figure(1, len(joints), 2.6)
    for axis, joint in zip(axes[0], joints, strict=True):
        unit, scale = unit_of(scenario, joint)
        _area(axis, scenario, joint)
        seen: list[Array] = []
        for place, (one, ticks, _) in enumerate(runs):
            q, qd = (scale * vectors(ticks, name)[:, joint] for name in ("q", "qd"))
            at = np.union1d(extremes(q, BUCKETS), extremes(qd, BUCKETS))
            axis.plot(
                q[at],
                qd[at],
                color=one.colour,
                linestyle=DASHES[one.dash],
                label=one.case.cell.formulation,
                linewidth=_nested(place, len(runs)),
            )
            seen.append(np.array([[q.min(), q.max()], [qd.min(), qd.max()]]))
        _zoom(axis, np.array(seen))
        axis.set_xlabel(f"{scenario.robot.joint_names[joint]}: position [{unit}]")
        axis.set_ylabel(f"velocity [{unit}/s]")
    _legend(made, axes[0][0])
    return made


def _closed_loops(series: Sequence[Series], scenario: Scenario) -> list[tuple[Series, pl.DataFrame, Array]]:
    """Runs in which one tick leads to the next, with their accelerations."""
    runs = []
    for one in series:
        if one.ticks is not None and len(one.ticks):
            acceleration = acceleration_share(one.ticks, scenario)
            if acceleration is not None:
                runs.append((one, one.ticks, acceleration))
    return runs


def _nested(place: int, count: int) -> float:
    """Line width: runs that coincide are seen nonetheless, the first widest and the last on top."""
    return 0.9 + 1.2 * (count - 1 - place)


def _zoom(axis: Axes, seen: Array) -> None:
    """Show where the runs were, with half as much again around; `seen` has shape (runs, 2, 2)."""
    low, high = seen[:, :, 0].min(axis=0), seen[:, :, 1].max(axis=0)
    room = np.maximum(0.5 * (high - low), 2.0)
    axis.set_xlim(low[0] - room[0], high[0] + room[0])
    axis.set_ylim(low[1] - room[1], high[1] + room[1])


def _area(axis: Axes, scenario: Scenario, joint: int) -> None:
    area = envelope(scenario, joint)
    if area is None:
        return
    axis.fill_between(area.q, *area.bounds["viable"], color="0.5", alpha=0.12, linewidth=0.0)
    for name, (low, high) in area.bounds.items():
        dash, label = _LINES[name]
        axis.plot(area.q, low, color="0.5", linestyle=dash, linewidth=0.7, label=label)
        axis.plot(area.q, high, color="0.5", linestyle=dash, linewidth=0.7)


def _legend(made: Figure, axis: Axes) -> None:
    lines, labels = axis.get_legend_handles_labels()
    made.legend(lines, labels, loc="outside lower center", ncols=min(len(labels), 4))
