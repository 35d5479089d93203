"""The page in a real browser: it opens from a file without errors, tables sort and filter, plots have data."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from selenium.webdriver.support.ui import WebDriverWait

from kinqp.benchmarks.report import write_report
from tests.benchmarks.report.browser import browser, missing

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from selenium.webdriver import Chrome

    from kinqp.benchmarks import Store

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing() or "a browser is here")

# What stands where there is no number.
NOTHING = "\u2013"
PLOTS = ("map", "profile", "means", "iterations", "times", "cut", "cdf", "singular", "phase")
TINY = "tests.benchmarks.tiny:"


@pytest.fixture(scope="module")
def page(swept: Store, tmp_path_factory: pytest.TempPathFactory) -> Path:
    written = write_report(swept, figures=False).page
    # Away from the results: it must not need them.
    alone = tmp_path_factory.mktemp("alone") / "page.html"
    return written.rename(alone)


@pytest.fixture(scope="module")
def chrome() -> Iterator[Chrome]:
    with browser() as driver:
        yield driver


@pytest.fixture
def opened(chrome: Chrome, page: Path) -> Chrome:
    # From about:blank, or another fragment of the same page would not load it anew.
    chrome.get("about:blank")
    chrome.get(page.as_uri())
    drawn(chrome, 1)
    return chrome


def drawn(driver: Chrome, at_least: int) -> None:
    WebDriverWait(driver, 30).until(
        lambda d: int(d.execute_script("return document.body.dataset.drawn || 0")) >= at_least
    )


def turn(driver: Chrome) -> int:
    return int(driver.execute_script("return document.body.dataset.drawn"))


def choose(driver: Chrome, select: str, value: str) -> None:
    before = turn(driver)
    there = driver.execute_script(
        "const one = document.getElementById(arguments[0]); one.value = arguments[1]; "
        "one.dispatchEvent(new Event('change')); return one.value", select, value,
    )  # fmt: skip
    assert there == value, f"{select} has no {value}"
    if select in ("scenario", "by", "formulation", "solver", "start", "clock"):
        drawn(driver, before + 1)


def traces(driver: Chrome, plot: str) -> list[dict[str, object]]:
    return driver.execute_script(
        "return (document.getElementById(arguments[0]).data || []).map("
        "t => ({name: t.name || '', n: t.x ? t.x.length : 0, y: Array.from(t.y || []), x: Array.from(t.x || [])}))",
        f"plot-{plot}",
    )


def rows(driver: Chrome) -> list[list[str]]:
    return driver.execute_script(
        "return Array.from(document.querySelectorAll('#cells-table tbody tr'))"
        ".map(r => Array.from(r.cells).map(c => c.textContent))"
    )


def heading(driver: Chrome, key: str) -> None:
    driver.execute_script("document.querySelector(`#cells-table th[data-key='${arguments[0]}'] button`).click()", key)


def column(driver: Chrome, key: str) -> list[str]:
    keys = driver.execute_script(
        "return Array.from(document.querySelectorAll('#cells-table th')).map(h => h.dataset.key)"
    )
    return [row[keys.index(key)] for row in rows(driver)]


def shown_filter(driver: Chrome, text: str) -> None:
    box = driver.find_element("id", "filter")
    driver.execute_script(
        "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))", box, text
    )


def test_it_opens_without_errors_and_asks_the_network_for_nothing(opened: Chrome) -> None:
    assert [entry for entry in opened.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []
    loaded = opened.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
    assert [name for name in loaded if not name.startswith(("data:", "blob:"))] == []


def test_every_plot_has_data(opened: Chrome) -> None:
    for plot in PLOTS:
        found = traces(opened, plot)
        assert found, plot
        assert all(one["n"] for one in found), plot
        size = opened.execute_script(
            "return document.getElementById(arguments[0]).getBoundingClientRect().height", f"plot-{plot}"
        )
        assert size > 100, plot


def test_curves_are_those_of_the_cells(opened: Chrome, swept: Store) -> None:
    cells = {
        cell.solver: cell
        for cell in swept.cells()
        if cell.scenario == TINY + "tiny" and cell.start == "cold" and cell.formulation == "cartesian-error"
    }
    drawn_traces = {one["name"]: one for one in traces(opened, "iterations")}
    assert set(drawn_traces) >= {"active-set", "clarabel", TINY + "Lying"}
    for name, one in drawn_traces.items():
        # Twenty ticks: nothing is thinned.
        assert one["y"] == swept.ticks(cells[str(name)])["iterations"].to_list()
    timed = {one["name"]: one for one in traces(opened, "times")}
    wall = swept.times(cells["clarabel"]).drop_nulls("wall_update")
    seconds = (wall["wall_update"] + wall["wall_solve"]).to_list()
    assert sorted(timed["clarabel"]["y"]) == pytest.approx([1e6 * s for s in sorted(seconds)], rel=1e-3)


def test_clocks_are_never_mixed(opened: Chrome) -> None:
    for clock, some in (("own", {"clarabel"}), ("c", {"active-set"})):
        choose(opened, "clock", clock)
        for plot in ("times", "cut", "cdf"):
            assert {one["name"] for one in traces(opened, plot)} == some, (clock, plot)
    choose(opened, "by", "formulations")
    choose(opened, "clock", "own")
    assert traces(opened, "cdf") == []
    assert "Choose another" in opened.find_element("id", "plot-cdf").text


def test_the_selectors_change_what_is_drawn(opened: Chrome) -> None:
    choose(opened, "scenario", TINY + "two_phases")
    assert max(max(one["x"]) for one in traces(opened, "iterations")) == pytest.approx(0.013)
    choose(opened, "by", "formulations")
    assert {one["name"] for one in traces(opened, "iterations")} == {
        "cartesian-error", "joint-space", "gradient-projection", "task-priority",
    }  # fmt: skip
    choose(opened, "scenario", TINY + "three_states")
    assert all(one["x"] == [0, 1, 2] for one in traces(opened, "iterations"))
    assert traces(opened, "phase") == []
    assert opened.current_url.endswith("clock=wall")
    assert "three_states" in opened.current_url


def test_chips_hide_and_show(opened: Chrome) -> None:
    before = len(traces(opened, "cdf"))
    chip = next(one for one in opened.find_elements("css selector", ".chip") if one.text == "clarabel")
    at = turn(opened)
    opened.execute_script("arguments[0].click()", chip)
    drawn(opened, at + 1)
    assert len(traces(opened, "cdf")) == before - 1
    assert "clarabel" not in {one["name"] for one in traces(opened, "cdf")}


def test_the_table_sorts_by_numbers_and_by_words(opened: Chrome) -> None:
    heading(opened, "iterations_mean")
    there = [float(text) for text in column(opened, "iterations_mean") if text != NOTHING]
    assert there == sorted(there)
    assert len(set(there)) > 1
    heading(opened, "iterations_mean")
    falling = column(opened, "iterations_mean")
    assert [float(text) for text in falling if text != NOTHING] == sorted(there, reverse=True)
    assert falling[-1] == NOTHING, "what is missing comes last either way"
    heading(opened, "solver")
    names = column(opened, "solver")
    assert names == sorted(names, key=str.lower)
    assert opened.execute_script("return document.querySelector('th[aria-sort]').dataset.key") == "solver"


def test_the_table_filters_by_words_and_comparisons(opened: Chrome) -> None:
    total = len(rows(opened))
    shown_filter(opened, "joint-space clarabel")
    assert len(rows(opened)) == 3
    assert {(row[1], row[2]) for row in rows(opened)} == {("joint-space", "clarabel")}
    shown_filter(opened, "iterations_mean>=7")
    assert all(float(text) >= 7 for text in column(opened, "iterations_mean"))
    assert 0 < len(rows(opened)) < total
    shown_filter(opened, "no such cell")
    assert rows(opened) == []
    assert opened.find_element("id", "count").text.startswith("0 of")
    shown_filter(opened, "")
    choose(opened, "only-state", "dishonest")
    assert {row[2] for row in rows(opened)} == {TINY + "Lying"}


def test_columns_come_in_groups(opened: Chrome) -> None:
    few = len(rows(opened)[0])
    choose(opened, "group", "all")
    assert len(rows(opened)[0]) > 60 > few


def test_a_row_leads_to_its_figures(opened: Chrome) -> None:
    shown_filter(opened, "two_phases joint-space active-set")
    at = turn(opened)
    opened.execute_script("document.querySelector('#cells-table tbody tr').click()")
    drawn(opened, at + 1)
    assert opened.find_element("id", "scenario").get_property("value") == TINY + "two_phases"
    assert opened.find_element("id", "formulation").get_property("value") == "joint-space"


def test_a_baseline_is_shown_by_its_name_whatever_solver_is_chosen(opened: Chrome, swept: Store) -> None:
    shown_filter(opened, "tiny:tiny task-priority")
    assert column(opened, "solver") == column(opened, "start") == ["-"]
    at = turn(opened)
    opened.execute_script("document.querySelector('#cells-table tbody tr').click()")
    drawn(opened, at + 1)
    assert opened.find_element("id", "formulation").get_property("value") == "task-priority"
    (shown,) = traces(opened, "iterations")
    (cell,) = (one for one in swept.cells() if one.scenario == TINY + "tiny" and one.formulation == "task-priority")
    assert (shown["name"], shown["y"]) == ("task-priority", swept.ticks(cell)["iterations"].to_list())
    assert [one["name"] for one in traces(opened, "cdf")] == ["task-priority"]
    assert "task-priority" not in {one["name"] for one in traces(opened, "profile")}
    for solver in ("active-set", "clarabel"):
        choose(opened, "map-solver", solver)
        fields = opened.execute_script("const d = document.getElementById('plot-map').data[0]; return [d.y, d.z]")
        assert None not in fields[1][fields[0].index("task-priority")]


def test_failures_are_named_with_reasons(opened: Chrome) -> None:
    text = opened.find_element("id", "failed-table").text
    assert re.search(r"Crashing.* failed .*(SIGSEGV|signal|crash)", text), text
    assert re.search(r"Lying.* dishonest claimed to have solved what it had not at 50 % of ticks", text), text
    assert "clarabel" not in text


def test_the_scorecard_has_the_ten_requirements(opened: Chrome) -> None:
    assert len(opened.find_elements("css selector", "#score-table thead th")) == 12
    visible = opened.execute_script(
        "return Array.from(document.querySelectorAll('#score-table tbody tr')).filter(r => !r.hidden).length"
    )
    assert visible == 4, "one row per formulation of the solver chosen, and one per baseline"
    assert opened.find_elements("css selector", "#score-table td.pass")


def test_conditions_and_limitations_are_there(opened: Chrome, swept: Store) -> None:
    text = opened.find_element("id", "conditions").text
    for name in ("cpu", "git", "python", "clarabel"):
        assert f"{name}\n{swept.manifest.conditions[name]}" in text, name
    assert len(opened.find_elements("css selector", "#limitations li")) >= 8


def test_dark_and_light(opened: Chrome) -> None:
    def background() -> str:
        return opened.execute_script("return getComputedStyle(document.body).backgroundColor")

    before = background()
    opened.find_element("id", "theme").click()
    assert background() != before
    opened.find_element("id", "theme").click()
    assert background() == before
    assert [entry for entry in opened.get_log("browser") if entry["level"] == "SEVERE"] == []
