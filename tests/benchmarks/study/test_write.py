"""What is written of a study, without a browser."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

import pytest

from kinqp.benchmarks.study.limitations import limitations
from kinqp.benchmarks.study.pattern import verdicts

if TYPE_CHECKING:
    from kinqp.benchmarks.study import StudyResult
    from kinqp.benchmarks.study.write import Written

PLOTS = ("elbow", "elbow-phase", "joints", "outcomes", "questionnaire")
#: What a page may weigh [bytes].
MOST = 15_000_000


def test_figures_are_png_and_svg(written: Written) -> None:
    assert {path.name for path in written.figures} == {
        f"{name}.{kind}" for name in (*PLOTS, "arm") for kind in ("png", "svg")
    }
    for path in written.figures:
        begins = path.read_bytes()[:5]
        assert begins == (b"\x89PNG\r" if path.suffix == ".png" else b"<?xml"), path
        assert path.stat().st_size > 10_000, path


def test_the_summary_holds_verdicts_and_tests(study: StudyResult, written: Written) -> None:
    summary = json.loads((written.page.parent / "summary.json").read_text(encoding="utf-8"))
    expected = verdicts(study, written.findings.tests)
    assert [(one["key"], one["holds"]) for one in summary["verdicts"]] == [(one.key, one.holds) for one in expected]
    assert len(summary["tests"]) == len(written.findings.tests)
    assert [round(one["chi2"], 2) for one in summary["thesis"][:2]] == [8.23, 0.76]
    assert [round(value, 2) for value in summary["thesis"][2]["chi2_42_answers"]] == [13.27, 13.27]
    assert summary["conditions"]["date"] == "today"
    median = summary["medians"]["elbow_peak_qdd"]["C all"]
    assert median[1] <= median[0] <= median[2] <= study.settings.qdd_max[3]


def test_the_page_is_one_file_that_says_what_was_found(study: StudyResult, written: Written) -> None:
    assert written.page.stat().st_size < MOST
    html = written.page.read_text(encoding="utf-8")
    outside = re.sub(r"<script.*?</script>", "", html, flags=re.DOTALL)
    assert re.findall(r"(?:src|href)=[\"'](?!#|data:)", outside) == []
    for said in ("8.23", "0.76", "13.27", "11.24", "24.55", "38 answers of 42", "none of the 4 missing answers is a 5"):
        assert said in outside, said
    for verdict in written.findings.verdicts:
        assert f'id="verdict-{verdict.key}"' in outside
    for name, count in study.settings.counts.items():
        assert f"{count} {name}s" in outside


def test_limitations_of_this_study_are_named(study: StudyResult) -> None:
    usual = limitations(study)
    assert any(f"Only {study.settings.operators} operators" in one for one in usual)
    broken = study.trials.clone()
    broken = broken.with_columns(finished=broken["algorithm"] != "B", unsolved=broken["unsolved"] + 1)
    told = limitations(type(study)(broken, study.runs, study.torques, study.settings))
    assert any(f"arrived: {study.trials.height // 3} of B." in one for one in told)
    assert any(f"At {study.trials.height} ticks" in one for one in told)


@pytest.mark.parametrize("word", ["NaN", "Infinity"])
def test_no_number_is_missing_in_what_scripts_read(written: Written, word: str) -> None:
    html = written.page.read_text(encoding="utf-8")
    (data,) = re.findall(r'<script type="application/json" id="animation-data">(.*?)</script>', html, flags=re.DOTALL)
    assert word not in data
