"""The generated C of the weighted, damped and scaled formulations against the interpreted step."""

import pytest

from tests.codegen.compiled import build_all
from tests.codegen.test_parity import check_parity

FORMULATIONS = ("damped", "joint-space-weighted", "minimum-kinetic-energy", "minimum-velocity-norm", "task-scaling")


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_compiled_and_interpreted_steps_agree(formulation: str) -> None:
    cases = [("lbr_med14", "fix-orientation"), ("ur5e", "rcm:0.1"), ("panda", "line:z")]
    build_all([(robot, formulation, mode) for robot, mode in cases])
    for robot, mode in cases:
        check_parity(robot, formulation, mode, 18)


@pytest.mark.long
@pytest.mark.parametrize("mode", ["free", "position", "fix-orientation", "fix-position", "line:z", "rcm:0.1"])
@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e", "panda"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_they_agree_on_many_states(formulation: str, robot: str, mode: str) -> None:
    check_parity(robot, formulation, mode, 120)
