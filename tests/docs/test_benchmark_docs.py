"""What the pages on scenarios and metrics say is what the code has."""

import re
from pathlib import Path

import numpy as np
import pytest

from kinqp.benchmarks import REQUIREMENTS, available_scenarios, cell_record, get_scenario
from tests.benchmarks.hand_made import scenario, ticks_frame

DOCS = Path(__file__).parents[2] / "docs"
SCENARIOS = (DOCS / "scenarios.md").read_text(encoding="utf-8")
METRICS = (DOCS / "metrics.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", available_scenarios())
def test_every_scenario_is_described_with_its_length(name: str) -> None:
    row = re.search(rf"^\| `{name}` \|.*\| (\d+) \|$", SCENARIOS, flags=re.MULTILINE)
    assert row is not None
    assert int(row[1]) == get_scenario(name).ticks


@pytest.mark.parametrize("requirement", REQUIREMENTS, ids=lambda each: each.key)
def test_every_requirement_is_defined_as_it_is_measured(requirement) -> None:
    (row,) = (line for line in METRICS.splitlines() if line.startswith(f"| {requirement.number} |"))
    side = "from" if requirement.at_least else "up to"
    for part in (
        requirement.text, f"`{requirement.key}`", requirement.definition, f"| {side} {requirement.threshold:g} |",
    ):  # fmt: skip
        assert part in row
    assert ("(stand-in)" in row) == requirement.stand_in


def test_every_column_of_a_record_is_explained() -> None:
    known = {"scenario", "formulation", "solver", "start", "expects", "ticks"}
    requirements = {f"requirement_{each.key}" for each in REQUIREMENTS}
    for name in set(cell_record(ticks_frame(2), None, scenario(2)).flat()) - known - requirements:
        # One group of times, and one percentile of it, stands for all.
        time = re.fullmatch(r"(wall|update|solve|setup|own|c)_(.+)", name)
        if time:
            assert f"`{time[1]}`" in METRICS, name
            assert f"wall_{time[2]}" in METRICS or f"`{time[2].partition('_')[0]}`" in METRICS, name
            continue
        stem, _, suffix = name.rpartition("_")
        assert f"`{name}`" in METRICS or (f"`{stem}" in METRICS and f"`_{suffix}`" in METRICS), name


def test_the_numbers_of_the_infeasible_one() -> None:
    inputs = get_scenario("infeasible").inputs
    assert np.max(inputs["qd_max"]) * 7 == pytest.approx(0.35)
    assert np.min(inputs["v_fixed"]) == 0.5
