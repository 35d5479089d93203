"""Ticks by the million over any bits: an independent judge finds no command outside of what its status promises."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest

from kinqp.formulations import available_formulations
from tests.formulations.reference import MEMORYLESS
from tests.gate.programs import build

if TYPE_CHECKING:
    from pathlib import Path

    from tests.gate.programs import Program, Verdict

# Ticks of the long test in all.
LONG = int(float(os.environ.get("KINQP_JUDGED_TICKS", "1e8")))
SHORT = 20_000
# Modes by pairs: the second one is switched to.
MODES = (("fix-orientation", "line:z"), ("rcm:-0.12", "plane:1,-2,0.5"), ("fix-position", "free"))
HOWS = ("step", "batch", "guide")
# What the judge must find where ticks are broken on purpose; in `damage` of the drivers.
STEP_DAMAGE = {
    1: "not-finite",
    2: "speed",
    3: "position",
    4: "locked-rows",
    5: "parameter",
    6: "stop-acceleration",
    7: "locked-rows",
    8: "stop-direction",
    9: "parameter",
    10: "input",
}
GUIDING_DAMAGE = {1: "not-finite", 2: "stop-acceleration", 3: "state", 4: "state", 5: "speed", 6: "status"}
# Quick to compile; the bits are those of any other optimisation.
QUICK = ("-O1",)
# Ticks that take a tenth of the time come up more often.
WEIGHTS = {name: 12 if name in MEMORYLESS else 1 for name in available_formulations()}


def check(verdict: Verdict) -> None:
    """See that nothing was found, and that there was something to be found."""
    assert not verdict.wrong, f"{verdict.wrong}\n{verdict.first}"
    assert verdict.usable > verdict.ticks / 4
    assert verdict.stops > verdict.ticks / 100


@pytest.fixture(scope="module")
def step(tmp_path_factory: pytest.TempPathFactory) -> Program:
    return build(tmp_path_factory.mktemp("step"), "cartesian-error-acceleration", MODES[0], flags=QUICK)


@pytest.fixture(scope="module")
def guiding(tmp_path_factory: pytest.TempPathFactory) -> Program:
    return build(tmp_path_factory.mktemp("guiding"), "joint-space", MODES[1], guiding=True, flags=QUICK)


@pytest.mark.parametrize("how", HOWS)
def test_steps_keep_their_promises(step: Program, how: str) -> None:
    check(step(SHORT, 1, how))


def test_hand_guiding_keeps_its_promises(guiding: Program) -> None:
    check(guiding(5 * SHORT, 1, "guiding"))


@pytest.mark.parametrize(("broken", "kind"), STEP_DAMAGE.items())
def test_the_judge_finds_a_step_that_breaks_a_promise(step: Program, broken: int, kind: str) -> None:
    for how in ("step", "guide"):
        assert step(SHORT // 4, 2, how, broken=broken).wrong.get(kind, 0) > 0


@pytest.mark.parametrize(("broken", "kind"), GUIDING_DAMAGE.items())
def test_the_judge_finds_hand_guiding_that_breaks_a_promise(guiding: Program, broken: int, kind: str) -> None:
    assert guiding(SHORT, 2, "guiding", broken=broken).wrong.get(kind, 0) > 0


@pytest.mark.long
@pytest.mark.parametrize("formulation", available_formulations())
def test_every_formulation_keeps_its_promises(formulation: str, tmp_path: Path) -> None:
    names = available_formulations()
    number, share = names.index(formulation), WEIGHTS[formulation] / sum(WEIGHTS.values())
    ticks = int(LONG * share / (len(HOWS) + 1)) + 1
    folders = [tmp_path / "step", tmp_path / "guiding"]
    for folder, is_guiding in zip(folders, (False, True), strict=True):
        folder.mkdir()
        # All pairs of modes come up in steps and in guiding; not with every formulation.
        modes = MODES[(number + is_guiding) % len(MODES)]
        program = build(folder, formulation, modes, guiding=is_guiding, flags=QUICK)
        for how in ("guiding",) if is_guiding else HOWS:
            check(program(ticks, number, how))
