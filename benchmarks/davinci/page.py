"""The study as one HTML file that loads nothing."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np

from ..charts import to_plotly
from . import document
from .matrix import matrix_latex, to_mathml

if TYPE_CHECKING:
    from pathlib import Path

    from ..charts import Chart
    from .run import Davinci

# Which figures of the report a chart stands for, by its key; those without are new.
_FIGURES = {
    "workspace-sparse": "figure 2",
    "workspace-dense": "figures 3 and 8",
    "workspace-xy": "figures 4 and 8",
    "workspace-xz": "figure 4, as announced",
    "example": "figures 5 and 6",
    "path": "figure 7",
    "near-path-xy": "figures 9 and 10",
    "near-path-xz": "figure 10",
    "points-148-xz": "figure 11",
    "points-148-xy": "figure 12",
    "cubic": "figure 13",
    "joint-1-theta8": "figure 14",
    "joint-2-d9": "figure 15",
    "joint-3-theta10": "figure 16",
    "joint-4-theta11": "figure 17",
    "joint-5-theta12": "figure 18",
}
# Questions of the report, and the keys of charts that each begins with.
_SECTIONS = (
    ("2", "Workspace", ("workspace-",)),
    ("3", "Inverse kinematics", ("example",)),
    ("4", "Spiral", ("path", "near-path-", "points-", "error")),
    ("5", "Trajectories", ("cubic", "joint-", "velocity-use", "acceleration-use", "tool")),
)


def write_page(found: Davinci, charts: tuple[Chart, ...], path: Path) -> None:
    """Write the page.

    Parameters
    ----------
    found : Davinci
    charts : tuple of Chart
        All that it shows.
    path : Path
        File to write.
    """
    import plotly.io as pio
    from plotly.offline import get_plotlyjs

    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=True, trim_blocks=True)
    template = environment.from_string(files(__package__).joinpath("page.html.j2").read_text(encoding="utf-8"))
    shown = [
        {
            "key": chart.key,
            "figure": _FIGURES.get(chart.key, "new"),
            "caption": chart.caption,
            "html": pio.to_html(
                to_plotly(chart),
                full_html=False,
                include_plotlyjs=False,
                div_id=f"chart-{chart.key}",
                config={"displaylogo": False, "responsive": True},
            ),
        }
        for chart in charts
    ]
    sections = [
        (number, title, [chart for chart in shown if chart["key"].startswith(keys)])
        for number, title, keys in _SECTIONS
    ]
    page = template.render(
        plotly=get_plotlyjs(),
        sections=sections,
        latex=matrix_latex(),
        entries=[_entry(entry) for entry in found.entries],
        checks=_checks(found),
        example=found.example,
        joints=_joints(found),
        spirals=found.summary()["spirals"],
        samples=found.workspace.samples,
        document=document,
    )
    path.write_text(page, encoding="utf-8")


def _entry(entry: Any) -> dict[str, Any]:
    return {
        "place": f"({entry.row}, {entry.column})",
        "same": entry.same,
        "ours": to_mathml(entry.ours),
        "printed": to_mathml(entry.printed),
        "difference_math": to_mathml(entry.difference),
    }


def _joints(found: Davinci) -> list[dict[str, str]]:
    """The example's joint positions beside the bounds and the report's start."""
    scale = np.array([1e3 if name.startswith("d") else np.rad2deg(1.0) for name in found.robot.joint_names])
    start = scale * np.array(document.START) * np.where(scale == 1e3, 1e-3, 1.0)
    rows = zip(
        found.robot.joint_names,
        scale * found.robot.q_min,
        scale * found.robot.q_max,
        start,
        scale * found.example.q,
        strict=True,
    )
    return [
        {
            "name": name,
            "unit": "mm" if name.startswith("d") else "°",
            "low": f"{low:.1f}",
            "high": f"{high:.1f}",
            "start": f"{begin:.2f}",
            "outside": "outside" if not low - 1e-9 <= begin <= high + 1e-9 else "",
            "q": f"{q:.3f}",
        }
        for name, low, high, begin, q in rows
    ]


def _checks(found: Davinci) -> dict[str, Any]:
    checks = found.checks

    def point(values: Any) -> str:
        return "(" + ", ".join(f"{value:.3f}" for value in values) + ") mm"

    settled = [
        f"{name} is {'in' if inside else 'not in'} range (figure 6: {said})"
        if known
        else f"{name} can't be judged: rounded to ±0.5 rad (figure 6: {said})"
        for name, inside, known, said in zip(
            found.robot.joint_names, checks.ranges, checks.ranges_known, document.CHECK_PARAM, strict=True
        )
    ]
    return {
        "initial": point(checks.initial),
        "printed_initial": point(document.PRINTED_INITIAL),
        "outside": ", ".join(checks.outside),
        "final_radians": point(checks.final_radians),
        "final_degrees": point(checks.final_degrees),
        "printed_final": point(document.PRINTED_FINAL),
        "distance": f"{checks.final_distance:.2f}",
        "rounded": f"{checks.final_rounded:.1g}",
        "error": f"{checks.error:.3f}",
        "ranges": settled,
    }
