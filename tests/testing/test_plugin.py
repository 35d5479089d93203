"""The pytest plug-in: exact iterations, plain refusals, and nothing at all for tests that don't ask."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinqp.control import make_step
from kinqp.robots import load_robot
from kinqp.testing.trial import Trial

if TYPE_CHECKING:
    from pathlib import Path

pytest_plugins = ["pytester"]

MINE = """
from kinqp.formulations import Formulation

class Mine(Formulation):
    \"\"\"Smallest joint velocity beside the task.\"\"\"
    name = "mine"

    def declare(self, qp, tick):
        eps = qp.variable("eps", tick.m_free)
        qd = qp.variable("qd", tick.nv)
        qp.minimize(eps, weight=tick.parameter("task_weight", 1.0, size=tick.m_free, lowest=0.0, positive=True))
        qp.minimize(qd, weight=tick.parameter("joint_weight", 1e-3, size=tick.nv, lowest=0.0, positive=True))
        qp.equal(tick.J_free @ qd - eps, tick.v, name="task")
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)
"""


def test_a_formulation_of_ones_own_is_run(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(mine=MINE)
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.kinqp(formulation="mine:Mine", ticks=30, seed=2)
        def test_mine(kinqp_formulation):
            assert all(status.value == "solved" for status in kinqp_formulation.statuses)
            assert max(kinqp_formulation.iterations) >= 1
            assert kinqp_formulation.time_ratio > 0.0

        @pytest.mark.kinqp("mine:Mine", ticks=30, seed=2)
        def test_that_got_worse(kinqp_formulation):
            assert max(kinqp_formulation.iterations) == 0
        """
    )
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "--strict-markers")
    result.assert_outcomes(passed=1, failed=1)


@pytest.mark.parametrize(
    ("marker", "message"),
    [
        ("@pytest.mark.kinqp", "got no formulation"),
        ("@pytest.mark.kinqp('joint-space', tick=3)", "got tick"),
        ("@pytest.mark.kinqp('joint-space', 'active-set')", "expected one formulation and all else by name"),
        ("@pytest.mark.kinqp('joint-space', ticks=0)", "ticks: expected at least 1, got 0"),
        ("", "expected the test to be marked"),
    ],
)
def test_what_is_wrong_with_a_marker_is_said(pytester: pytest.Pytester, marker: str, message: str) -> None:
    pytester.makepyfile(f"import pytest\n{marker}\ndef test_it(kinqp_formulation):\n    pass\n")
    result = pytester.runpytest("-p", "no:cacheprovider")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([f"*{message}*"])


def test_unused_it_imports_nothing_heavy(tmp_path: Path) -> None:
    (tmp_path / "test_other.py").write_text(
        "import sys\ndef test_it():\n"
        "    assert 'kinqp.testing.plugin' in sys.modules\n"
        "    assert not {'numpy', 'casadi', 'kinqp.control', 'kinqp.robots', 'polars'} & set(sys.modules)\n"
    )
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:benchmark", str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


def test_iterations_are_those_of_the_step_and_the_same_again() -> None:
    trial, again = (Trial("cartesian-error", ticks=40, seed=5) for _ in range(2))
    assert trial.iterations == again.iterations
    step = make_step(load_robot("lbr_med14"), "cartesian-error", "fix-orientation", solver="active-set")
    q, v = trial.states
    assert trial.iterations == tuple(step(*state).iterations for state in zip(q, v, strict=True))
    assert max(trial.iterations) >= 1
    robot = load_robot("lbr_med14")
    assert ((q >= robot.q_min) & (q <= robot.q_max)).all()
    assert Trial("cartesian-error", ticks=40, seed=6).states[0].tolist() != q.tolist()
    assert np.isfinite(v).all()


def test_formulations_that_ask_for_the_last_command_start_at_rest() -> None:
    trial = Trial("joint-space-robust", ticks=10, seed=1)
    step = make_step(load_robot("lbr_med14"), "joint-space-robust", "fix-orientation")
    wanted = [step(q, v, qd_prev=np.zeros(7)).iterations for q, v in zip(*trial.states, strict=True)]
    assert list(trial.iterations) == wanted
    assert trial.time_ratio > 0.0
