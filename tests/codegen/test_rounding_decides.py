"""States at which rounding used to decide: both codes, and the same state but for rounding, give the same command."""

import numpy as np
import pytest

from kinqp.solvers import Status
from tests.codegen.compiled import compiled, interpreted
from tests.robots.arms import arm

TURN = 2.0 * np.pi
# The first, fifth and sixth joint move only together here, in the ratio 1.5 : -1.1 : 1e5. The last two are beyond a
# limit, with opposite signs: they leave a plane of directions, of which rounding blocked half.
TOGETHER = np.array([5.100462414405614, TURN, 1.409499561036255, 2.46636954201562, -TURN - 1e-5, -TURN - 1e-9])
HANDS = {"fix-orientation": [-1142.4, 217.8, 1017.3], "plane:1,-2,0.5": [-0.22848006461175965, 0.04355838680188455]}
LAST = {
    "fix-orientation": [0.018781867892988274, 0.0, -0.021069489715484755, 0.008204575493314001, 0.0, 0.0],
    "plane:1,-2,0.5": [-0.967555305610479, 0.0, 2.2850649293576866, -2.1069489715484755, 0.8204575493314001, 0.0],
}
BLOCKED = [
    ("ur5e", "cartesian-error", "fix-orientation"),
    ("ur5e", "cartesian-error-acceleration", "fix-orientation"),
    ("ur5e", "cartesian-error-acceleration", "plane:1,-2,0.5"),
]
# Singular, and singular all along the self-motion: no way out is on the arm's own side.
LINE = "line:z"
TIES = (
    (
        [TURN, -TURN, -np.pi, -4.228702, -2.302474, -3.408019],
        2.493418,
        [-0.22, 0.0, 0.0, -0.2, 0.45, -0.03],
    ),
    ([TURN, TURN, np.pi, -TURN, 0.762754, TURN], 0.087541, [0.0] * 6),
)
ROBUST = ("joint-space-robust", "cartesian-error-robust")


@pytest.mark.parametrize("case", BLOCKED, ids="-".join)
def test_joints_that_move_only_together_block_no_other_direction(case: tuple[str, str, str]) -> None:
    robot, _, mode = case
    step, reference = compiled(*case, quick=True), interpreted(*case)
    rng = np.random.default_rng(0)
    given = {"qd_prev": LAST[mode]} if "qd_prev" in step.inputs else {}
    commands = []
    for _ in range(12):
        q = TOGETHER + 1e-12 * rng.choice([-1.0, 1.0], 6)
        for one in (step(q, HANDS[mode], **given), reference(q, HANDS[mode], **given)):
            assert one.status is Status.SOLVED
            commands.append(one.qd)
    assert np.ptp(commands, axis=0).max() < 1e-4
    # What opens the way is below 1e-9; a hair within the limit the bound is as much.
    assert np.max(commands, axis=0)[1] <= 2e-9
    assert np.min(commands, axis=0)[4:].min() >= -2e-9
    assert np.abs(commands).max() <= arm(robot).qd_max.max() + 1e-9


@pytest.mark.parametrize("formulation", ROBUST)
def test_where_both_ways_out_are_as_good_both_codes_take_the_same(formulation: str) -> None:
    case = ("ur5e", formulation, LINE)
    step, reference = compiled(*case, quick=True), interpreted(*case)
    rng = np.random.default_rng(0)
    for place, v, qd_prev in TIES:
        commands = []
        for _ in range(12):
            q = np.array(place) + 4e-15 * rng.choice([-1.0, 0.0, 1.0], 6)
            for one in (step(q, [v], qd_prev=qd_prev), reference(q, [v], qd_prev=qd_prev)):
                assert one.status is Status.SOLVED
                commands.append(one.qd)
        assert np.abs(commands).max() > 1e-3
        assert np.ptp(commands, axis=0).max() < 1e-6
