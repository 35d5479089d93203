"""Formulations by name, and one of a user's own from declaration to answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from kinqp.formulations import (
    CartesianError,
    Formulation,
    JointSpace,
    Mode,
    QuadraticProgram,
    Tick,
    available_formulations,
    get_formulation,
)
from kinqp.solvers import PluginError, UnknownOptionError, solve
from tests.formulations.reference import evaluator
from tests.robots.arms import arm

ROBOT = arm("ur5e")


@dataclass(frozen=True)
class DampedLeastSquares(Formulation):
    """A third formulation, as a user would write it."""

    name: ClassVar[str] = "damped-least-squares"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        qd = qp.variable("qd", tick.nv)
        qp.minimize(tick.J_free @ qd - tick.v, name="task")
        qp.minimize(qd, weight=tick.parameter("damping", 0.1, lowest=0.0) ** 2, name="damping")
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)


def test_a_formulation_in_a_few_lines_works_end_to_end() -> None:
    robot, rng = arm("lbr_med14"), np.random.default_rng(4)
    step = evaluator("lbr_med14", DampedLeastSquares(), "position")
    assert step.lowered.rows.box == tuple(f"joint limits[{i}]" for i in range(7))
    for damping in (0.1, 0.3):
        q, v = 0.5 * robot.random_configuration(rng), 0.1 * rng.normal(size=3)
        instance = step(q=q, v=v, damping=damping)
        assert instance.qp.x_feasible is None
        solution = solve(instance.qp)
        assert solution.solved
        J = robot.jacobian(q)[:3]
        expected = J.T @ np.linalg.solve(J @ J.T + damping**2 * np.eye(3), v)
        assert np.all(np.abs(expected) < 0.9 * instance.qd_hi)  # else the formula does not hold
        np.testing.assert_allclose(instance.K @ solution.x + instance.k, expected, atol=1e-6)
    # On a limit, towards it: the joint stops, and the rest goes on.
    q[3], v = robot.q_max[3], np.array([0.0, 0.0, -0.2])
    instance = step(q=q, v=v)
    solution = solve(instance.qp)
    assert solution.x[3] <= 1e-9
    np.testing.assert_array_equal(instance.qd_hi[3], 0.0)


def test_registry() -> None:
    assert available_formulations() == (
        "cartesian-error",
        "cartesian-error-acceleration",
        "cartesian-error-robust",
        "damped",
        "hierarchical",
        "joint-space",
        "joint-space-acceleration",
        "joint-space-robust",
        "joint-space-weighted",
        "minimum-acceleration-norm",
        "minimum-kinetic-energy",
        "minimum-torque-norm",
        "minimum-velocity-norm",
        "task-scaling",
    )
    assert get_formulation("cartesian-error") == CartesianError()
    assert get_formulation("joint-space", bounds="thesis") == JointSpace("thesis")
    assert get_formulation("joint-space(bounds=thesis)") == JointSpace("thesis")
    assert get_formulation("tests.formulations.test_registry:DampedLeastSquares").name == "damped-least-squares"
    instance = DampedLeastSquares()
    assert get_formulation(instance) is instance
    with pytest.raises(PluginError, match="'nope' does not exist; the choices are cartesian-error, "):
        get_formulation("nope")
    with pytest.raises(PluginError, match="expected no options with an instance, got bounds"):
        get_formulation(instance, bounds="thesis")
    with pytest.raises(UnknownOptionError, match="'speed' does not exist; the choices are bounds"):
        get_formulation("joint-space", speed=1)
    with pytest.raises(ValueError, match=r"^bounds: expected one of thesis, viable, got 'square'"):
        JointSpace("square")
    with pytest.raises(ValueError, match=r"^bounds: expected one of thesis, viable, got 'square'"):
        Tick(ROBOT, Mode.free(), "square")
