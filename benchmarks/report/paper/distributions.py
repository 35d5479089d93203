"""Distributions of times and performance profiles, one panel per clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.ticker import PercentFormatter

from ..downsample import distribution
from ..series import CLOCKS, samples
from .style import DASHES, figure

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..profiles import Profile
    from .style import Series


def distributions_figure(series: Sequence[Series]) -> Figure | None:
    """Share of solves within a time, logarithmic: a row per formulation, a column per clock; None without times."""
    curves = {}
    for one in series:
        for clock in CLOCKS:
            found = None if one.times is None else samples(one.times, clock)
            if found is not None and found.seconds.size:
                curves[one.case.cell, clock] = one, distribution(1e6 * found.seconds)
    if not curves:
        return None
    formulations = list(dict.fromkeys(cell.formulation for cell, _ in curves))
    clocks = [clock for clock in CLOCKS if any(clock == key for _, key in curves)]
    made, axes = figure(len(formulations), len(clocks), 1.7, sharey="all", sharex="col")
    for (cell, clock), (one, (shares, at)) in curves.items():
        axis = axes[formulations.index(cell.formulation)][clocks.index(clock)]
        axis.step(
            at,
            shares,
            where="post",
            color=one.colour,
            linestyle=DASHES[one.dash],
            label=cell.formulation if cell.is_baseline else cell.solver,
        )
    for row, formulation in enumerate(formulations):
        axes[row][0].set_ylabel(f"{formulation}\nshare of solves")
    for column, clock in enumerate(clocks):
        axes[0][column].set_title(CLOCKS[clock], loc="left", fontsize=7)
        axes[-1][column].set_xlabel("time [µs]")
    for axis in (axis for row in axes for axis in row):
        axis.set_xscale("log")
        _shares(axis)
    _legend(made, [axis for row in axes for axis in row])
    return made


def profile_figure(profiles: Mapping[str, Profile], styles: Mapping[str, tuple[str, str]]) -> Figure | None:
    """Performance profiles, one panel per clock; None where there is none."""
    there = {clock: profile for clock, profile in profiles.items() if profile.curves}
    if not there:
        return None
    made, axes = figure(1, len(there), 2.4, sharey="all")
    for axis, (clock, profile) in zip(axes[0], there.items(), strict=True):
        for curve in profile.curves:
            colour, dash = styles[curve.solver]
            axis.step(curve.ratio, curve.share, where="post", color=colour, linestyle=DASHES[dash], label=curve.name)
        axis.set_title(CLOCKS[clock], loc="left")
        axis.set_xlabel("time over that of the fastest")
        axis.set_xscale("log")
        _shares(axis)
    axes[0][0].set_ylabel("share of problems")
    _legend(made, axes[0])
    return made


def _shares(axis: Axes) -> None:
    axis.set_ylim(0.0, 1.02)
    axis.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))


def _legend(made: Figure, axes: Sequence[Axes]) -> None:
    """One legend for all panels, below them."""
    found = {label: line for axis in axes for line, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    made.legend(found.values(), found.keys(), loc="outside lower center", ncols=min(len(found), 5))
