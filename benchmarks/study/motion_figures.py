"""What the joints did in the representative trial: all of them, and the elbow (thesis, sections 5.3.1 to 5.3.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

from ...formulations.bounds import velocity_bounds
from ..report.palette import COLOURS
from .panels import ALGORITHM_COLOURS, LIMIT_COLOUR, Band, Line, Panel, PanelFigure, thinned

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...control import GuidedRun
    from .panels import Content
    from .result import StudyResult, StudySettings

    Array = NDArray[np.float64]

_DEG: Final = 180.0 / np.pi
# Stretches of a run of which the smallest and largest value are drawn.
_BUCKETS: Final = 450
# An algorithm with values so many times as large as all others would leave nothing to be seen of these.
_DWARFING: Final = 3.0
# Smallest acceleration on the logarithmic axis [rad/s^2]: below is rounding.
_FLOOR: Final = 1e-6
_COLUMN: Final = {"A": "A: task priority", "B": "B: saturation in the null space", "C": "C: QP"}


def column_title(letter: str, settings: StudySettings) -> str:
    """Heading of an algorithm's column: the thesis's name for it, or that of what took its place."""
    usual = {"A": "task-priority", "B": "saturation-null-space", "C": "joint-space"}
    name = settings.algorithms[letter]
    return _COLUMN[letter] if usual.get(letter) == name else f"{letter}: {name}"


def joint_figure(found: StudyResult, *, buckets: int = _BUCKETS) -> PanelFigure:
    """Position, velocity, acceleration and torque of all joints, a column for each algorithm."""
    quantities: list[tuple[str, str, Callable[[str, GuidedRun], Array]]] = [
        ("position", "°", lambda _, run: _DEG * run.q),
        ("velocity", "rad/s", lambda _, run: run.qd),
        ("acceleration", "rad/s²", lambda _, run: run.acceleration()),
        ("torque", "Nm", lambda letter, _: found.torques[letter]),
    ]
    rows, cuts = [], []
    for number, (name, unit, of) in enumerate(quantities):
        values = {letter: of(letter, run) for letter, run in found.runs.items()}
        shown = _cut({letter: float(np.abs(one).max()) for letter, one in values.items()})
        if shown is not None:
            beyond = [
                f"{one} reaches {np.abs(v).max():,.0f} {unit}" for one, v in values.items() if np.abs(v).max() > shown
            ]
            cuts.append(f"The axis of the {name} is cut: {', '.join(beyond)}.")
        rows.append(
            tuple(
                Panel(
                    column_title(letter, found.settings) if number == 0 else "",
                    "time [s]",
                    f"{name} [{unit}]",
                    tuple(
                        thinned(f"joint {joint + 1}", run.t, column, COLOURS[joint % len(COLOURS)], buckets=buckets)
                        for joint, column in enumerate(values[letter].T)
                    ),
                    y_range=None if shown is None else (-shown, shown),
                )
                for letter, run in found.runs.items()
            )
        )
    caption = (
        "One trial of the same simulated operator with each algorithm. Accelerations are differences of the commands; "
        "torques follow from them by inverse dynamics with published inertias of the KUKA iiwa 14, gravity included."
    )
    return PanelFigure(
        "joints",
        "All joints",
        " ".join([caption, *cuts]),
        tuple(rows),
        share_y=True,
        share_x=True,
        row_height=230,
    )


def _cut(largest: dict[str, float]) -> float | None:
    """Where to cut an axis that one algorithm would have for itself, beside the others; None: nowhere."""
    ordered = sorted(largest.values())
    return 1.25 * ordered[-2] if len(ordered) > 1 and ordered[-1] > _DWARFING * ordered[-2] else None


def elbow_figure(found: StudyResult, *, buckets: int = 2 * _BUCKETS) -> PanelFigure:
    """The elbow's position and limit, velocity and bounds, acceleration and limit, also as a logarithm (5.3.4)."""
    settings, elbow = found.settings, found.settings.elbow
    columns = [
        _elbow_column(letter, run, settings, elbow, buckets, title=column_title(letter, settings))
        for letter, run in found.runs.items()
    ]
    return PanelFigure(
        "elbow",
        f"The elbow (joint {elbow + 1})",
        "The same trials. Grey: the velocities from which the joint can still brake in time at its acceleration limit "
        "(the bounds of C). Below, the size of the acceleration as a logarithm, as the thesis argues with orders "
        "of magnitude.",
        tuple(zip(*columns, strict=True)),
        share_y=True,
        share_x=True,
        row_height=230,
    )


def _elbow_column(
    letter: str, run: GuidedRun, settings: StudySettings, elbow: int, buckets: int, *, title: str
) -> tuple[Panel, ...]:
    colour, ends = ALGORITHM_COLOURS[letter], run.t[[0, -1]]
    q, qd, qdd = run.q[:, elbow], run.qd[:, elbow], run.acceleration()[:, elbow]
    low, high = _DEG * settings.q_min[elbow], _DEG * settings.q_max[elbow]
    most = settings.qdd_max[elbow]
    nearest = low if np.min(q) * _DEG - low < high - np.max(q) * _DEG else high

    def curve(values: Array) -> Line:
        return thinned(letter, run.t, values, colour, buckets=buckets, width=1.6)

    def limit(*values: float) -> list[Content]:
        return [
            Line("limit" if number == 0 else "", ends, np.full(2, value), LIMIT_COLOUR, "dash", 1.1)
            for number, value in enumerate(values)
        ]

    every = max(1, len(run.t) // (2 * buckets))
    lower, upper = elbow_bounds(q[::every], settings)
    shown = 1.25 * max(float(np.max(np.abs(qd))), 0.05)
    band = Band("admissible velocities", run.t[::every], np.maximum(lower, -shown), np.minimum(upper, shown))
    size = np.maximum(np.abs(qdd), _FLOOR)
    return (
        Panel(title, "time [s]", "position [°]", (curve(_DEG * q), *limit(nearest))),
        Panel("", "time [s]", "velocity [rad/s]", (band, curve(qd))),
        Panel("", "time [s]", "acceleration [rad/s²]", (curve(qdd), *limit(-most, most))),
        Panel("", "time [s]", "|acceleration| [rad/s²]", (curve(size), *limit(most)), log_y=True),
    )


def elbow_phase_figure(found: StudyResult) -> PanelFigure:
    """Velocity over position of the elbow next to its limit, with the area of admissible velocities (figure 4.1)."""
    settings, elbow = found.settings, found.settings.elbow
    every = np.concatenate([run.q[:, elbow] for run in found.runs.values()])
    low, high = settings.q_min[elbow], settings.q_max[elbow]
    at_low = every.min() - low < high - every.max()
    limit, inwards = (low, 1.0) if at_low else (high, -1.0)
    # As far from the limit as the fastest of them needs to brake, and as much again.
    fastest = max(float(np.abs(run.qd[:, elbow]).max()) for run in found.runs.values())
    reach = max(2.0 * 0.5 * fastest**2 / settings.qdd_max[elbow], np.deg2rad(0.25))
    # Dense towards the limit, where the braking curve is steep.
    grid = limit + inwards * reach * np.linspace(0.0, 1.0, 240) ** 2
    lower, upper = elbow_bounds(grid, settings)
    most = 1.25 * max(fastest, 0.05)
    band = Band("admissible velocities", _DEG * grid, np.maximum(lower, -most), np.minimum(upper, most))
    panels = []
    for letter, run in found.runs.items():
        q, qd = run.q[:, elbow], run.qd[:, elbow]
        near = np.abs(q - limit) <= reach
        # Whatever is farther away is a gap; the ticks at which nothing changes are not drawn.
        q, qd = np.where(near, _DEG * q, np.nan), np.where(near, qd, np.nan)
        changes = np.append(True, (np.abs(np.diff(q)) > 1e-6) | (np.abs(np.diff(qd)) > 1e-6) | np.diff(near))
        line = Line(letter, q[changes], qd[changes], ALGORITHM_COLOURS[letter], width=1.6)
        panels.append(
            Panel(
                column_title(letter, settings), "position [°]", "velocity [rad/s]", (band, line), y_range=(-most, most)
            )
        )
    return PanelFigure(
        "elbow-phase",
        "The elbow's velocity over its position, next to its limit",
        "A curve that leaves the grey area towards the limit can no longer stop in time at the acceleration limit: it "
        "falls to zero at once, which is the hard stop.",
        (tuple(panels),),
        share_y=True,
        row_height=330,
    )


def elbow_bounds(q: Array, settings: StudySettings) -> tuple[Array, Array]:
    """Smallest and largest admissible velocity of the elbow at positions of shape (N,) [rad]: (N,) each [rad/s]."""
    at, elbow = ca.SX.sym("q"), settings.elbow
    q_min, q_max, qd_max, qdd_max = (
        ca.SX(limits[elbow]) for limits in (settings.q_min, settings.q_max, settings.qd_max, settings.qdd_max)
    )
    both = velocity_bounds("viable", at, q_min, q_max, qd_max, qdd_max, ca.SX(settings.dt))
    lower, upper = ca.Function("bounds", [at], list(both))(np.asarray(q)[None, :])
    return np.array(lower).ravel(), np.array(upper).ravel()
