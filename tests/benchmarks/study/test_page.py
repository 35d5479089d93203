"""The page in a real browser: it opens from a file without errors, plots have data, the animation plays."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import pytest
from selenium.webdriver.support.ui import WebDriverWait

from tests.benchmarks.report.browser import browser, missing
from tests.benchmarks.study.test_write import PLOTS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from selenium.webdriver import Chrome

    from kinqp.benchmarks.study import StudyResult
    from kinqp.benchmarks.study.write import Written

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing() or "a browser is here")


@pytest.fixture(scope="module")
def opened(written: Written, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    # Away from the results: it must not need them.
    alone = tmp_path_factory.mktemp("alone") / "page.html"
    alone.write_bytes(written.page.read_bytes())
    with browser() as driver:
        driver.get(alone.as_uri())
        WebDriverWait(driver, 30).until(
            lambda d: d.execute_script("return document.getElementById('plot-questionnaire')._fullLayout != null")
        )
        yield driver


def text(driver: Chrome, name: str) -> str:
    return str(driver.execute_script("return document.getElementById(arguments[0]).textContent", name))


def clock(driver: Chrome) -> float:
    return float(text(driver, "time").removesuffix(" s"))


def go_to(driver: Chrome, seconds: float) -> None:
    driver.execute_script(
        "const s = document.getElementById('slider'); s.value = arguments[0]; s.dispatchEvent(new Event('input'))",
        seconds,
    )


def keep(driver: Chrome) -> None:
    """Remember what the canvases show."""
    driver.execute_script(
        "window.kept = ['A', 'B', 'C'].map(l => { const c = document.getElementById(`scene-${l}`);"
        "return c.getContext('2d').getImageData(0, 0, c.width, c.height).data; })"
    )


def changed(driver: Chrome) -> list[float]:
    """Share of each canvas's pixels that are clearly not what was kept; browsers do not paint twice the same."""
    return list(
        driver.execute_script(
            "return ['A', 'B', 'C'].map((l, n) => { const c = document.getElementById(`scene-${l}`);"
            "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let count = 0;"
            "for (let i = 0; i < d.length; i++) count += Math.abs(d[i] - window.kept[n][i]) > 40;"
            "return count / d.length; })"
        )
    )


def colours(driver: Chrome, name: str) -> int:
    """How many different colours a canvas has."""
    return int(
        driver.execute_script(
            "const c = document.getElementById(arguments[0]); const d = c.getContext('2d')"
            ".getImageData(0, 0, c.width, c.height).data; const seen = new Set();"
            "for (let i = 0; i < d.length; i += 4) seen.add(d[i] << 16 | d[i + 1] << 8 | d[i + 2]);"
            "return seen.size",
            name,
        )
    )  # fmt: skip


def test_it_opens_without_errors_and_asks_the_network_for_nothing(opened: Chrome) -> None:
    assert [entry for entry in opened.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []
    loaded = opened.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
    assert [name for name in loaded if not name.startswith(("data:", "blob:"))] == []


@pytest.mark.parametrize("plot", PLOTS)
def test_every_plot_has_data(opened: Chrome, plot: str) -> None:
    counts = opened.execute_script(
        "return document.getElementById(arguments[0])._fullData.map(t => t._length ?? t.y.length)", f"plot-{plot}"
    )
    assert len(counts) >= 6
    assert all(counts)
    box = opened.execute_script(
        "const b = document.getElementById(arguments[0]).getBoundingClientRect(); return [b.width, b.height]",
        f"plot-{plot}",
    )
    assert box[0] > 600
    assert box[1] > 300


def test_the_elbow_that_is_drawn_is_the_one_that_was_measured(opened: Chrome, study: StudyResult) -> None:
    highest = opened.execute_script(
        "const rows = document.getElementById('plot-elbow')._fullData.filter(t => t.name === 'A');"
        "return rows.map(t => Math.max(...Array.from(t.y).map(Math.abs)))"
    )
    run = study.runs["A"]
    peak = np.abs(run.acceleration()[:, 3]).max()
    assert highest == pytest.approx(
        [np.rad2deg(np.abs(run.q[:, 3]).max()), np.abs(run.qd[:, 3]).max(), peak, peak], rel=1e-5
    )


def test_the_animation_shows_something_before_it_plays(opened: Chrome) -> None:
    for letter in "ABC":
        assert colours(opened, f"scene-{letter}") > 100
    assert colours(opened, "ribbons") > 5


def test_the_animation_plays_and_pauses(opened: Chrome) -> None:
    go_to(opened, 0.0)
    keep(opened)
    opened.execute_script("document.getElementById('play').click()")
    WebDriverWait(opened, 20).until(lambda d: clock(d) > 0.5)
    assert text(opened, "play") == "Pause"
    opened.execute_script("document.getElementById('play').click()")
    there = clock(opened)
    assert min(changed(opened)) > 0.005
    time.sleep(0.3)
    assert clock(opened) == there
    assert text(opened, "play") == "Play"


def test_it_plays_to_the_end_and_starts_again(opened: Chrome, study: StudyResult) -> None:
    last = max(run.t[-1] for run in study.runs.values())
    go_to(opened, last - 0.2)
    opened.execute_script("document.getElementById('play').click()")
    WebDriverWait(opened, 20).until(lambda d: text(d, "play") == "Play")
    assert clock(opened) == pytest.approx(last, abs=0.01)
    for letter, run in study.runs.items():
        assert text(opened, f"state-{letter}") == f"finished after {run.t[-1]:.1f} s"
    opened.execute_script("document.getElementById('play').click()")
    WebDriverWait(opened, 20).until(lambda d: clock(d) < last - 0.5)
    opened.execute_script("document.getElementById('play').click()")


def test_states_are_those_of_the_runs(opened: Chrome, study: StudyResult, written: Written) -> None:
    still = written.findings.still["B"]
    begin = int(np.argmax(still))
    length = int(np.argmax(~still[begin:]))
    go_to(opened, (begin + 0.5 * length) * study.settings.dt)
    assert text(opened, "state-B") == "standing still"
    assert text(opened, "speed-B") in ("0 mm/s", "1 mm/s")
    go_to(opened, 0.2)
    assert [text(opened, f"state-{letter}") for letter in "ABC"] == ["moving freely"] * 3
    on = np.flatnonzero(study.runs["C"].q[:, 3] <= study.settings.q_min[3] + 1e-9)
    go_to(opened, on[len(on) // 2] * study.settings.dt)
    assert text(opened, "state-C") == "sliding: elbow at its limit"
    assert text(opened, "angle-C") == "-120.0°"


def test_dragging_turns_all_three(opened: Chrome) -> None:
    keep(opened)
    opened.execute_script(
        "document.getElementById('scene-A').dispatchEvent("
        "new PointerEvent('pointermove', {buttons: 1, movementX: 60, movementY: 10}))"
    )
    assert min(changed(opened)) > 0.02
    opened.execute_script("document.getElementById('view').click()")
    assert max(changed(opened)) < 0.002


def test_tables_are_filled(opened: Chrome) -> None:
    for name, least in (("medians", 14), ("tests", 14), ("thesis-tests", 9), ("extremes", 21), ("characters", 1)):
        cells = opened.execute_script(
            "return Array.from(document.querySelectorAll(`#${arguments[0]} tbody tr`)).map(r => "
            "Array.from(r.cells).map(c => c.textContent.trim()))",
            name,
        )
        assert len(cells) >= least, name
        assert all(row[0] for row in cells), name


def test_nothing_is_logged_after_all_that(opened: Chrome) -> None:
    assert [entry for entry in opened.get_log("browser") if entry["level"] == "SEVERE"] == []
