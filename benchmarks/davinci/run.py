"""All of the study: compute, write data, pictures and the page."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...control import CubicStopAndGo, InverseKinematics
from ...robots import load_robot, sample_workspace
from .. import arm_charts
from ..arm_study import motion_frame, study_path, workspace_frame
from ..charts import BLUE, GREEN, ORANGE, RED, Chart, Series, save_png
from . import document
from .checks import check_document, to_si
from .matrix import compare_matrix, matrix_latex
from .page import write_page

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from ...control import IkResult
    from ...robots import Robot, Workspace
    from ..arm_study import PathStudy
    from .checks import Checks
    from .matrix import Entry

    Array = NDArray[np.float64]

_SAMPLES: Final = 1_000_000
_SPACING: Final = 2e-3
# A point of the cloud is near the path within this [m]; the report's ring is as wide.
_NEAR: Final = 2e-3


@dataclass(frozen=True)
class Davinci:
    """Everything that the study found.

    Attributes
    ----------
    robot : Robot
    entries : tuple of Entry
        A_8^12, compared.
    checks : Checks
        The report's figures for question 3, tested.
    example : IkResult
        The report's inverse kinematics, solved.
    workspace : Workspace
    studies : tuple of PathStudy
        Of 148 and of 72 points.
    """

    robot: Robot
    entries: tuple[Entry, ...]
    checks: Checks
    example: IkResult
    workspace: Workspace
    studies: tuple[PathStudy, ...]

    def summary(self) -> dict[str, Any]:
        """Figures in millimetres and seconds, ready for JSON."""
        return {
            "matrix": {"entries": 16, "different": [[e.row, e.column] for e in self.entries if not e.same]},
            "workspace": {
                "samples": self.workspace.samples,
                "points": len(self.workspace.points),
                "spacing_mm": 1e3 * self.workspace.spacing,
                "volume_mm3": 1e9 * self.workspace.volume,
            },
            "example": {
                "q": self.example.q.tolist(),
                "error_mm": 1e3 * self.example.error,
                "steps": self.example.total_steps,
                "starts": self.example.starts,
            },
            "spirals": [_spiral_summary(study) for study in self.studies],
        }


def _spiral_summary(study: PathStudy) -> dict[str, Any]:
    error = 1e3 * study.solution.error
    return {
        "points": study.count,
        "reached": int(study.reachable.sum()),
        "mean_error_mm": float(error.mean()),
        "largest_error_mm": float(error.max()),
        "second_opinion_off_by_mm": 1e3 * study.disagreement,
        "steps": study.solution.steps,
        "durations_s": {motion.name: float(motion.joints.t[-1]) for motion in study.motions},
    }


def run_davinci(
    out: Path,
    *,
    counts: tuple[int, ...] = document.COUNTS,
    samples: int = _SAMPLES,
    spacing: float = _SPACING,
    on_stage: Callable[[str], None] | None = None,
) -> Davinci:
    """Run the study and write it to a folder.

    Parameters
    ----------
    out : Path
        Made if need be; files of an earlier run are overwritten. It will hold `index.html`, `summary.json`,
        `A_8_12.tex`, `data/*.parquet` and `figures/*.png`.
    counts : tuple of int
        Points of each spiral; motions are drawn for the first.
    samples, spacing : int, float
        Of the workspace [-, m].
    on_stage : callable, optional
        Told what is being done.
    """
    tell = on_stage or (lambda _: None)
    robot = load_robot("davinci5")
    tell("symbolic matrix")
    entries, checks = compare_matrix(), check_document(robot)
    tell("inverse kinematics")
    # Few starts: where a target is out of reach, the second opinion makes many more.
    ik = InverseKinematics(robot, starts=2)
    example = ik(1e-3 * np.array(document.TARGET), to_si(document.START))
    tell("workspace")
    workspace = sample_workspace(robot, samples, spacing=spacing)
    studies = []
    for count in counts:
        tell(f"spiral of {count} points")
        studies.append(study_path(ik, document.SPIRAL.points(count), 0.5 * (robot.q_min + robot.q_max)))
    found = Davinci(robot, entries, checks, example, workspace, tuple(studies))
    tell("data, pictures, page")
    _write(found, out)
    return found


def _write(found: Davinci, out: Path) -> None:
    data, pictures = out / "data", out / "figures"
    for folder in (data, pictures):
        folder.mkdir(parents=True, exist_ok=True)
    workspace_frame(found.robot, found.workspace).write_parquet(data / "workspace.parquet")
    for study in found.studies:
        study.frame(found.robot).write_parquet(data / f"spiral-{study.count}.parquet")
        for number, motion in enumerate(study.motions):
            motion_frame(found.robot, motion).write_parquet(data / f"motion-{study.count}-{number + 1}.parquet")
    (out / "summary.json").write_text(json.dumps(found.summary(), indent=2) + "\n", encoding="utf-8")
    (out / "A_8_12.tex").write_text(matrix_latex() + "\n", encoding="utf-8")
    drawn = charts(found)
    for chart in drawn:
        save_png(chart, pictures / f"{chart.key}.png")
    write_page(found, drawn, out / "index.html")


def charts(found: Davinci) -> tuple[Chart, ...]:
    """All charts, in the order of the report's figures."""
    path = document.SPIRAL.points(600)
    first = found.studies[0]
    robot, space = found.robot, found.workspace
    planes = [arm_charts.workspace_plane(space, path, plane) for plane in ("xy", "xz", "yz")]
    return (
        arm_charts.workspace_sparse(space, path),
        arm_charts.workspace_dense(space, path),
        *planes,
        example_chart(found),
        arm_charts.solid_path(path),
        arm_charts.near_path(space, path, _NEAR, "xy"),
        arm_charts.near_path(space, path, _NEAR, "xz"),
        *(arm_charts.approximation(study, plane) for study in found.studies for plane in ("xz", "xy")),
        arm_charts.errors(found.studies),
        cubic_chart(),
        *(arm_charts.joint(robot, first, number) for number in range(robot.nv)),
        arm_charts.utilisation(robot, first, acceleration=False),
        arm_charts.utilisation(robot, first, acceleration=True),
        arm_charts.tool_solid(first),
        arm_charts.tool_deviation(first, document.SPIRAL.points(4_000)),
    )


def example_chart(found: Davinci) -> Chart:
    """Error of the report's example after every step."""
    target = 1e-3 * np.array(document.TARGET)
    gaps = [np.linalg.norm(found.robot.pose(q)[:3, 3] - target) for q in found.example.history]
    steps = np.arange(len(gaps), dtype=float)
    return Chart(
        "example",
        "Inverse kinematics of the report's example, error after every step",
        f"{found.example.steps} QPs, from the report's start moved to its bounds. The report: "
        f"{document.PRINTED_ITERATIONS} iterations to {document.PRINTED_ERROR} mm (sum of absolute differences).",
        ("QP steps [-]", "error [mm]"),
        (
            Series("error", steps, np.maximum(1e3 * np.array(gaps), 1e-13), "line", BLUE),
            Series("the report's last", steps[[0, -1]], np.full(2, document.PRINTED_ERROR), "dash", RED),
        ),
        log_y=True,
    )


def cubic_chart() -> Chart:
    """The report's example of a cubic (figure 13), with its velocity and acceleration."""
    begin, end, low, high = document.CUBIC_EXAMPLE
    sampled = CubicStopAndGo(np.array([[low], [high]]), np.array([begin, end])).at(np.linspace(begin, end, 201))
    return Chart(
        "cubic",
        "Third-order polynomial from 30 at rest to 60 at rest in 10 s",
        "Position, and, to the same scale, ten times velocity and acceleration.",
        ("time [s]", "position; 10 x velocity; 10 x acceleration"),
        (
            Series("position", sampled.t, sampled.q[:, 0], "line", BLUE),
            Series("10 x velocity", sampled.t, 10.0 * sampled.qd[:, 0], "line", GREEN),
            Series("10 x acceleration", sampled.t, 10.0 * sampled.qdd[:, 0], "line", ORANGE),
        ),
    )
