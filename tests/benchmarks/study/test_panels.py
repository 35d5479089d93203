"""Figures show what was measured, on the page and for a paper."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinqp.benchmarks.study.motion_figures import column_title, elbow_bounds, elbow_figure, joint_figure
from kinqp.benchmarks.study.outcome_figures import outcome_figure, questionnaire_figure
from kinqp.benchmarks.study.outcomes_table import OUTCOMES
from kinqp.benchmarks.study.panels import Band, Bars, Boxes, Line, Panel, PanelFigure, in_rows, log_ticks, thinned
from kinqp.benchmarks.study.panels_paper import to_paper
from kinqp.benchmarks.study.panels_plotly import to_plotly

if TYPE_CHECKING:
    from kinqp.benchmarks.study import StudyResult

T = np.linspace(0.0, 1.0, 11)
EXAMPLE = PanelFigure(
    "example",
    "Example",
    "",
    (
        (
            Panel("lines", "t", "y", (Band("band", T, -T, T), Line("one", T, T**2, "#112233"))),
            Panel("again", "t", "y", (Line("one", T, T, "#112233"), Line("", T, -T, "#445566", "dash")), log_y=True),
        ),
        (
            Panel(
                "bars",
                "",
                "n",
                (Bars("p", ("1", "2"), (3.0, 4.0), "#0000ff"), Bars("q", ("1", "2"), (1.0, 2.0), "#ff0000")),
            ),
            None,
        ),
    ),
)


def test_a_name_is_in_the_legend_once_and_hides_everywhere() -> None:
    figure = to_plotly(EXAMPLE)
    shown = [trace.name for trace in figure.data if trace.showlegend]
    assert shown == ["band", "one", "p", "q"]
    assert [trace.legendgroup for trace in figure.data if trace.name == "one"] == ["one", "one"]
    assert figure.layout.yaxis2.type == "log"
    np.testing.assert_allclose(figure.data[2].y, T**2, rtol=1e-6)


def test_both_drawings_have_all_panels() -> None:
    paper = to_paper(EXAMPLE)
    visible = [axis for axis in paper.axes if axis.get_visible()]
    assert [axis.get_title(loc="left") for axis in visible] == ["lines", "again", "bars"]
    assert [round(bar.get_height()) for bar in visible[2].patches] == [3, 4, 1, 2]
    assert [text.get_text() for text in paper.legends[0].get_texts()] == ["band", "one", "p", "q"]


def test_boxes_stand_on_their_categories() -> None:
    boxes = tuple(Boxes(name, (name,), (np.array([1.0, 2.0, 10.0]),), "#123456", "all") for name in "AB")
    figure = PanelFigure("b", "", "", ((Panel("", "", "", boxes),),))
    (axis,) = to_paper(figure).axes
    assert [tick.get_text() for tick in axis.get_xticklabels()] == ["A", "B"]
    traces = to_plotly(figure).data
    assert [set(trace.x) for trace in traces] == [{"A"}, {"B"}]
    assert {trace.offsetgroup for trace in traces} == {"all"}
    np.testing.assert_allclose(log_ticks(figure.panels[0]), [0.5, 1.0, 2.0, 5.0, 10.0, 20.0])


def test_thinning_keeps_a_spike() -> None:
    y = np.zeros(100_000)
    y[77_777] = 3.0
    line = thinned("spike", np.arange(y.size), y, "#000000", buckets=50)
    assert len(line.x) <= 100
    assert line.y.max() == 3.0
    assert line.x[line.y.argmax()] == 77_777


def test_rows_are_filled_up() -> None:
    panels = EXAMPLE.panels
    assert in_rows(panels, 2) == ((panels[0], panels[1]), (panels[2], None))


def test_all_joints_of_all_algorithms(study: StudyResult) -> None:
    figure = joint_figure(study)
    assert [len(row) for row in figure.rows] == [3, 3, 3, 3]
    for row, values in zip(
        figure.rows,
        (
            lambda run, _: np.rad2deg(run.q),
            lambda run, _: run.qd,
            lambda run, _: run.acceleration(),
            lambda _, tau: tau,
        ),
        strict=True,
    ):
        for panel, letter in zip(row, "ABC", strict=True):
            expected = values(study.runs[letter], study.torques[letter])
            assert len(panel.contents) == 7
            for line, column in zip(panel.contents, expected.T, strict=True):
                assert line.y.max() == column.max()
                assert line.y.min() == column.min()


def test_the_elbow_is_shown_with_its_limits(study: StudyResult) -> None:
    figure = elbow_figure(study)
    assert [row[0].y_label.split(" [")[0] for row in figure.rows] == [
        "position", "velocity", "acceleration", "|acceleration|",
    ]  # fmt: skip
    assert figure.rows[3][0].log_y
    for column in range(3):
        position, velocity, acceleration, size = (row[column] for row in figure.rows)
        assert [line.y[0] for line in position.contents if line.name == "limit"] == pytest.approx([-120.0])
        assert sorted(line.y[0] for line in acceleration.contents if line.style == "dash") == [-10.0, 10.0]
        assert isinstance(velocity.contents[0], Band)
        assert size.contents[0].y.min() > 0.0
    # B and C stay in the area, A leaves it.
    for letter in "BC":
        low, high = elbow_bounds(study.runs[letter].q[:, 3], study.settings)
        qd = study.runs[letter].qd[:, 3]
        assert np.all((low - 1e-9 <= qd) & (qd <= high + 1e-9))
    low, _ = elbow_bounds(study.runs["A"].q[:, 3], study.settings)
    assert np.any(study.runs["A"].qd[:, 3] < low - 0.01)


def test_bounds_of_the_elbow_by_hand(study: StudyResult) -> None:
    settings = study.settings
    limit, a, dt = settings.q_min[3], settings.qdd_max[3], settings.dt
    # One tick's braking from a dt stops within a dt^2: that is the bound there, and zero at the limit.
    low, high = elbow_bounds(np.array([limit, limit + a * dt**2, 0.0]), settings)
    np.testing.assert_allclose(low, [0.0, -a * dt, -settings.qd_max[3]], atol=1e-12)
    assert high[2] == settings.qd_max[3]


def test_outcomes_are_split_by_character(study: StudyResult) -> None:
    figure = outcome_figure(study.trials)
    same = {one.name for one in OUTCOMES if study.trials[one.key].n_unique() == 1}
    assert [panel.title for panel in figure.panels] == [one.name for one in OUTCOMES if one.name not in same]
    panel = figure.panels[0]
    assert [boxes.name for boxes in panel.contents] == ["expert", "novice"]
    drawn = np.sort(np.concatenate([values for boxes in panel.contents for values in boxes.values]))
    np.testing.assert_array_equal(drawn, np.sort(study.trials["time"].to_numpy()))
    for name in same:
        assert name in figure.caption


def test_the_questionnaire_is_as_printed(study: StudyResult) -> None:
    figure = questionnaire_figure(study.trials)
    assert len(figure.rows) == 3
    bars = figure.rows[2][0].contents
    assert [bar.heights for bar in bars] == [(0, 3, 15, 13, 7), (28, 10, 2, 2, 0), (0, 1, 5, 13, 23)]
    assert [panel.title for panel in figure.rows[1][1:]] == ["time to finish", "standing still"]


def test_another_algorithm_is_named_as_it_is(study: StudyResult) -> None:
    assert column_title("C", study.settings) == "C: QP"
    study.settings.algorithms["C"] = "cartesian-error"
    try:
        assert column_title("C", study.settings) == "C: cartesian-error"
    finally:
        study.settings.algorithms["C"] = "joint-space"
