"""An arm of one joint is an arm: a matrix of one column is a matrix, and all that moves arms moves it."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from kinqp.baselines import available_baselines
from kinqp.codegen import compile_step
from kinqp.control import IkStatus, inverse_kinematics, make_guiding, make_step, simulate
from kinqp.formulations import available_formulations
from kinqp.solvers import Status
from tests.robots.chains import chain, one_joint

KINDS = ("revolute", "prismatic")
Q = np.array([0.1])
# The tool's velocity, per unit of the joint's, 0.1 rad off the x-axis on a radius of 0.3 m.
COLUMN = {
    "revolute": [-0.3 * np.sin(0.1), 0.3 * np.cos(0.1), 0.0, 0.0, 0.0, 1.0],
    "prismatic": [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
}


class Pull:
    """A hand that pulls along the way that the joint has: not all formulations follow one that pulls elsewhere."""

    def __init__(self, kind: str) -> None:
        self._turns = kind == "revolute"

    def twist(self, t: float, pose: np.ndarray) -> np.ndarray:  # noqa: ARG002  # the interface's arguments
        along = np.cross([0.0, 0.0, 1.0], pose[:3, 3]) / 0.3 if self._turns else np.array([0.0, 0.0, 1.0])
        return np.concatenate([0.1 * along, np.zeros(3)])


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_numbers_have_the_shapes_that_are_documented(axes: int) -> None:
    robot = chain(axes)
    q = np.full(axes, 0.1)
    found = {
        "pose": robot.pose(q),
        "jacobian": robot.jacobian(q),
        "jdot_qd": robot.jdot_qd(q, q),
        "mass_matrix": robot.mass_matrix(q),
        "bias_forces": robot.bias_forces(q, q),
        "to_pinocchio": robot.to_pinocchio(q),
    }
    vector = (axes,)
    assert {name: value.shape for name, value in found.items()} == {
        "pose": (4, 4), "jacobian": (6, axes), "jdot_qd": (6,), "mass_matrix": (axes, axes), "bias_forces": vector,
        "to_pinocchio": vector,
    }  # fmt: skip
    assert robot.random_configuration(np.random.default_rng(0)).shape == vector
    # And the symbolic ones say the same.
    symbols = ca.SX.sym("q", axes), ca.SX.sym("qd", axes)
    walk = robot.symbolic(*symbols)
    for name in ("pose", "jacobian", "jdot_qd", "mass_matrix", "bias_forces"):
        value = np.array(ca.Function("f", list(symbols), [getattr(walk, name)])(q, q))
        np.testing.assert_allclose(value.reshape(found[name].shape), found[name], atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_the_jacobian_of_one_joint_is_one_column(kind: str) -> None:
    np.testing.assert_allclose(one_joint(kind).jacobian(Q), np.array(COLUMN[kind])[:, None], atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", [*available_formulations(), *available_baselines()])
def test_everything_that_resolves_motion_moves_one_joint(name: str, kind: str) -> None:
    run = simulate(make_step(one_joint(kind), name, "position"), Pull(kind), Q, 0.01)
    assert run.qd.shape == (10, 1)
    assert set(run.status) == {Status.SOLVED}
    assert run.qd[-1, 0] > 1e-4


@pytest.mark.parametrize("mode", ["position", "fix-orientation"])
def test_a_compiled_step_moves_one_joint_as_the_interpreted_one_does(mode: str) -> None:
    ours, compiled = (
        simulate(make(one_joint("prismatic"), "joint-space", mode), Pull("prismatic"), Q, 0.01)
        for make in (make_step, compile_step)
    )
    assert compiled.status == ours.status
    np.testing.assert_allclose(compiled.qd, ours.qd, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mode", ["position", "free"])
def test_inverse_kinematics_of_one_joint(mode: str, kind: str) -> None:
    robot = one_joint(kind)
    found = inverse_kinematics(robot, robot.pose([0.4]), Q, mode)
    assert found.status is IkStatus.REACHED
    np.testing.assert_allclose(found.q, [0.4], atol=1e-8)


def test_one_joint_is_guided_by_hand() -> None:
    controller = make_guiding(one_joint("prismatic"), "joint-space", ["position"])
    results = [controller(Q, np.array([0.0, 0.0, 10.0, 0.0, 0.0, 0.0])) for _ in range(5)]
    assert {result.status for result in results} == {Status.SOLVED}
    assert results[-1].qd[0] > 0.0
