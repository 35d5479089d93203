"""The representative trials as frames of an animation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from .motion_figures import column_title
from .panels import ALGORITHM_COLOURS
from .pattern import at_limit
from .skeleton import Skeleton

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...control import GuidedRun
    from .result import StudyResult

    Array = NDArray[np.float64]

#: Frames a second; between them the page interpolates.
RATE: Final = 30.0
_PATH_POINTS: Final = 121


def animation(found: StudyResult, path: Array, still: dict[str, NDArray[np.bool_]]) -> dict[str, Any]:
    """Return what the page's script draws, ready for JSON: positions in millimetres, forces in newtons.

    Parameters
    ----------
    found : StudyResult
    path : ndarray, shape (N, 3)
        The wanted path [m].
    still : dict of str to ndarray of bool, shape (N,)
        Ticks at which the tool stands still although the hand pulls, by algorithm.
    """
    settings = found.settings
    thin = path[np.linspace(0, len(path) - 1, _PATH_POINTS).round().astype(int)]
    skeleton = Skeleton(next(iter(found.runs.values())).robot)
    elbow = settings.elbow
    return {
        "rate": RATE,
        "path": _mm(thin),
        "elbow": skeleton.corner(elbow),
        "joint": elbow + 1,
        "limits": [round(float(np.rad2deg(limit)), 2) for limit in (settings.q_min[elbow], settings.q_max[elbow])],
        "most": settings.qdd_max[elbow],
        "runs": [
            {"letter": letter, "title": column_title(letter, settings), "colour": ALGORITHM_COLOURS[letter]}
            | _frames(run, skeleton, elbow, still[letter], (settings.q_min[elbow], settings.q_max[elbow]))
            for letter, run in found.runs.items()
        ],
    }


def _frames(
    run: GuidedRun, skeleton: Skeleton, elbow: int, still: NDArray[np.bool_], limits: tuple[float, float]
) -> dict[str, Any]:
    count = max(2, 1 + int(np.ceil(run.t[-1] * RATE)))
    ticks = np.minimum(np.round(np.arange(count) / (RATE * run.dt)).astype(int), len(run.t) - 1)
    # What lasts for one tick only must be seen: each frame stands for all ticks up to the next.
    spans = list(zip(ticks, np.maximum(np.append(ticks[1:], len(run.t)), ticks + 1), strict=True))
    acceleration = np.abs(run.acceleration()[:, elbow])
    on = at_limit(run, elbow, *limits)
    return {
        "duration": round(float(run.t[-1]), 3),
        "points": [_mm(skeleton(run.q[tick])) for tick in ticks],
        "force": [[round(float(value), 1) for value in run.wrench[tick, :3]] for tick in ticks],
        "speed": [round(float(np.linalg.norm(run.twist[tick, :3])), 4) for tick in ticks],
        "angle": [round(float(np.rad2deg(run.q[tick, elbow])), 2) for tick in ticks],
        "peak": [round(float(acceleration[begin:end].max()), 2) for begin, end in spans],
        "limit": [int(on[begin:end].any()) for begin, end in spans],
        "still": [int(still[begin:end].mean() >= 0.5) for begin, end in spans],
    }


def _mm(points: Array) -> list[list[float]]:
    return [[round(1e3 * float(value), 1) for value in point] for point in points]
