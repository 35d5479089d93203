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

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ...scenarios import Scenario
    from .style import Series

_LINES: Final = {"viable": ("-", "admissible"), "thesis": (":", "admissible (thesis, eq. 4.11)")}
_MOST_JOINTS: Final = 3


def singular_figure(series: Sequence[Series], scenario: Scenario) -> Figure | None:
    """Smallest singular value, joint accelerations and the share of the pull followed; None for states one by one."""
    runs = [(one, one.ticks) for one in series if one.ticks is not None and len(one.ticks)]
    if scenario.states is not None or not runs:
        return None
    made, axes = figure(3, 1, 1.3, sharex=True)
    for one, ticks in runs:
        curves = (
            ticks["sigma_min"].to_numpy(),
            acceleration_share(ticks, scenario),
            ticks["task_scale"].to_numpy(),
        )
        for (axis,), values in zip(axes, curves, strict=True):
            at = extremes(values, BUCKETS)
            t = positions(ticks, scenario)[at] * scenario.dt
            axis.plot(t, values[at], color=one.colour, linestyle=DASHES[one.dash], label=one.case.cell.formulation)
    for (axis,), label in zip(axes, ("smallest singular\nvalue", "largest joint accel.\nover its limit", "share of the\npull followed"), strict=True):
        axis.set_ylabel(label)
        axis.set_ylim(bottom=min(0.0, axis.get_ylim()[0]))
    axes[1][0].axhline(1.0, color="0.3", linewidth=0.7, linestyle="--")
    axes[-1][0].set_xlabel("time [s]")
    _legend(made, axes[0][0])
    return made


def phase_figure(series: Sequence[Series], scenario: Scenario) -> Figure | None:
    """Velocity over position of the watched joints, with the admissible area; None where there is nothing to watch."""
    runs = [(one, one.ticks) for one in series if one.ticks is not None and len(one.ticks)]
    joints = scenario.watched_joints[:_MOST_JOINTS]
    if scenario.states is not None or not runs or not joints:
        return None
    made, axes = figure(1, len(joints), 2.6)
    for axis, joint in zip(axes[0], joints, strict=True):
        unit, scale = unit_of(scenario, joint)
        _area(axis, scenario, joint)
        for one, ticks in runs:
            q, qd = (scale * vectors(ticks, name)[:, joint] for name in ("q", "qd"))
            at = np.union1d(extremes(q, BUCKETS), extremes(qd, BUCKETS))
            axis.plot(q[at], qd[at], color=one.colour, linestyle=DASHES[one.dash], label=one.case.cell.formulation)
        axis.set_xlabel(f"{scenario.robot.joint_names[joint]}: position [{unit}]")
        axis.set_ylabel(f"velocity [{unit}/s]")
    _legend(made, axes[0][0])
    return made


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
