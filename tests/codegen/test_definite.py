"""C is refused of what its solver can't take, and of nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import pytest

from kinqp.codegen import CurvatureError, compile_step, export_c
from kinqp.codegen.model import step_code
from kinqp.formulations import Formulation, Mode, QuadraticProgram, Tick
from tests.codegen.compiled import Everything
from tests.robots.arms import arm


@dataclass(frozen=True)
class Weighted(Formulation):
    """Cartesian error with a joint weight on some joints, and a slack with or without one."""

    joints: int = 7
    slack_weight: float = 1.0

    name: ClassVar[str] = "weighted"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State it."""
        qd, slack = qp.variable("qd", tick.nv), qp.variable("slack", 1)
        qp.minimize(tick.J_free @ qd - tick.v)
        if self.joints:
            qp.minimize(qd[: self.joints], weight=1e-4)
        qp.minimize(slack, weight=self.slack_weight)
        qp.minimize_linear(slack)
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.between(0.0, slack, 1.0, name="slack")
        qp.command(qd)


@pytest.mark.parametrize(
    ("made", "mode"),
    [
        (Weighted(joints=0), "fix-orientation"),  # seven joints, three rows locked, three guided: one direction is free
        (Weighted(joints=0), "position"),
        (Weighted(slack_weight=0.0), "fix-orientation"),
    ],
)
def test_flat_objectives_are_refused(made: Formulation, mode: str, tmp_path: object) -> None:
    with pytest.raises(CurvatureError, match=r"^weighted: expected an objective that gives every variable weight"):
        compile_step(arm("lbr_med14"), made, mode)
    with pytest.raises(CurvatureError, match=r"small weight$"):
        export_c(arm("lbr_med14"), made, [mode], f"{tmp_path}/out")


@pytest.mark.parametrize(
    ("made", "robot", "mode"),
    [
        (Weighted(), "lbr_med14", "fix-orientation"),
        (Weighted(joints=6), "lbr_med14", "fix-orientation"),
        # Six joints, six rows: none is free, whatever the weights.
        (Weighted(joints=0), "ur5e", "fix-orientation"),
        (Everything(), "lbr_med14", "position"),
    ],
)
def test_others_are_not(made: Formulation, robot: str, mode: str) -> None:
    assert step_code(arm(robot), made, [Mode.parse(mode)], "kinqp_weighted").modes[0].shape.gradient
