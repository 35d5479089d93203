"""The symbols of one control cycle: run-time inputs, the Jacobian's rate, the arm's dynamics."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from kinqp.formulations import Mode, Tick
from tests.finite_differences import difference_jacobian
from tests.formulations.reference import MODES
from tests.robots.arms import arm

ROBOT = arm("ur5e")


def test_parameters() -> None:
    tick = Tick(ROBOT, Mode.free())
    first = tick.parameter("gain", 2.0, size=3, unit="1/s")
    assert tick.parameter("gain", 5.0, size=3) is first
    given = tick.inputs[0]
    assert len(tick.inputs) == 1
    assert given.default is not None
    assert (given.name, given.size, given.unit, given.default.tolist()) == ("gain", 3, "1/s", [2.0, 2.0, 2.0])
    with pytest.raises(ValueError, match="parameter gain: expected its first size, 3, got 1"):
        tick.parameter("gain", 2.0)
    with pytest.raises(ValueError, match="parameter low: expected as default numbers not below 0 -, got -1"):
        tick.parameter("low", -1.0, lowest=0.0)
    with pytest.raises(ValueError, match="parameter zero: expected as default numbers above 0 -, got 0"):
        tick.parameter("zero", 0.0, lowest=0.0, positive=True)
    for bad in (np.nan, np.inf):
        with pytest.raises(ValueError, match="parameter odd: expected as default finite numbers"):
            tick.parameter("odd", bad)
    with pytest.raises(ValueError, match="parameter odd: expected as default numbers"):
        tick.parameter("odd", np.nan, may_be_infinite=True)


def test_what_is_not_asked_for_is_not_made() -> None:
    tick = Tick(ROBOT, Mode.fix_orientation())
    assert not tick.inputs
    _ = tick.qd_hi
    assert [given.name for given in tick.inputs] == ["q", "q_min", "q_max", "qd_max", "qdd_max", "dt"]


def test_an_unknown_force_limit_is_infinite() -> None:
    robot = arm("davinci5")
    tick = Tick(robot, Mode.position())
    assert tick.tau_max.shape == (5, 1)
    assert not np.isfinite(robot.tau_max).any()


@pytest.mark.parametrize("mode", [*MODES, "fix-position@tool"])
def test_rate_of_the_jacobian(mode: str) -> None:
    robot, read, rng = arm("lbr_med14"), Mode.parse(mode), np.random.default_rng(5)
    tick = Tick(robot, read)
    function = ca.Function("rate", [tick.q, tick.qd_prev], [tick.Jdot_qd])
    q, qd = robot.random_configuration(rng), rng.normal(size=7)

    def along(t: np.ndarray) -> np.ndarray:
        at = q + t[0] * qd
        return np.asarray(read.twist_map_at(robot.pose(at)) @ robot.jacobian(at) @ qd)

    expected = difference_jacobian(along, np.zeros(1))[:, 0]
    np.testing.assert_allclose(np.array(function(q, qd))[:, 0], expected, atol=1e-9)


def test_dynamics_are_those_of_the_arm() -> None:
    robot, rng = arm("lbr_med14"), np.random.default_rng(6)
    tick = Tick(robot, Mode.free())
    function = ca.Function("dynamics", [tick.q, tick.qd_prev], [ca.densify(tick.M), ca.densify(tick.h), tick.pose])
    q, qd = robot.random_configuration(rng), rng.normal(size=7)
    M, h, pose = (np.array(part) for part in function(q, qd))
    np.testing.assert_allclose(M, robot.mass_matrix(q), atol=1e-10)
    np.testing.assert_allclose(h[:, 0], robot.bias_forces(q, qd), atol=1e-9)
    np.testing.assert_allclose(pose, robot.pose(q), atol=1e-12)
