"""Every scenario does what it says, with our compiled step in the loop."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from kinqp.benchmarks import available_scenarios, get_scenario
from kinqp.benchmarks.scenarios.drilling import INSERTED, START_DEG, drill_self_collision, drilling_robot
from kinqp.benchmarks.scenarios.limits import CORRECTION, SLOWEST
from kinqp.benchmarks.scenarios.random_states import NEAR
from kinqp.benchmarks.scenarios.tool_modes import CAREFUL, PIVOT
from kinqp.codegen import compile_step
from kinqp.control import make_step
from kinqp.formulations import available_formulations, viable_bound
from kinqp.robots import capsule_model
from kinqp.solvers import Status

from .closed_loop import run

OURS = (
    "drill-line", "drilling", "infeasible", "limit-corner", "mode-switch", "random-states", "rcm-pivot", "semicircle",
    "singular-elbow", "singular-shoulder", "singular-wrist", "start-outside-limits", "workspace-boundary",
)  # fmt: skip
GUIDED = tuple(name for name in OURS if name not in ("infeasible", "random-states", "semicircle"))


def test_all_are_registered() -> None:
    assert set(OURS) <= set(available_scenarios())


@pytest.mark.parametrize("name", [name for name in OURS if name != "semicircle"])
def test_short_enough_for_a_thousand_cells(name: str) -> None:
    scenario = get_scenario(name)
    assert scenario.name == name
    assert 300 <= scenario.ticks <= 1500
    assert scenario.dt == 1e-3


@pytest.mark.parametrize("name", GUIDED)
def test_guided_ones_end_at_rest_with_the_mode_kept(name: str) -> None:
    made = run(name)
    assert np.max(made.error) < 1e-9
    assert not np.any(made.v[-1])
    assert np.max(np.abs(made.qd[-1])) < 1e-12
    limits = np.broadcast_to(np.asarray(made.scenario.inputs.get("qd_max", made.scenario.robot.qd_max)), made.qd.shape)
    assert np.all(np.abs(made.qd) <= limits + 1e-12)


@pytest.mark.parametrize(
    ("name", "joint"),
    [("singular-elbow", 3), ("singular-wrist", 5), ("singular-shoulder", 1), ("workspace-boundary", 3)],
)
def test_singular_ones_reach_their_singularity(name: str, joint: int) -> None:
    made = run(name)
    closest = int(np.argmin(made.sigma_min))
    assert made.sigma_min[0] > 4.0 * made.sigma_min[closest]
    assert made.sigma_min[closest] < 0.012
    # It is the joint of its name that gets close to zero there, and no limit has to do with it.
    assert abs(made.q[closest, joint]) < np.deg2rad(4.0)
    assert np.min(made.distance) > np.deg2rad(20.0)


@pytest.mark.parametrize(
    ("name", "times"), [("singular-elbow", 10.0), ("singular-wrist", 4.0), ("workspace-boundary", 5.0)]
)
def test_unprotected_joints_are_torn_there(name: str, times: float) -> None:
    made = run(name, "joint-space")
    acceleration = np.abs(np.diff(made.qd, axis=0, prepend=0.0)) / made.scenario.dt / made.scenario.robot.qdd_max
    assert np.max(acceleration) > times


def test_elbow_is_pulled_past_reach_and_back() -> None:
    made = run("singular-elbow", "joint-space")
    bend = -made.q[:, 3]
    assert np.min(bend) < 1e-3
    assert bend[-1] > bend[0]


def test_boundary_is_followed() -> None:
    """The tool moves on while it is stretched: 3 cm up, and down again."""
    made = run("workspace-boundary", "joint-space")
    height = np.array([made.scenario.robot.pose(q)[2, 3] for q in made.q[::10]])
    stretched = np.abs(made.q[::10, 3]) < np.deg2rad(2.0)
    assert np.mean(stretched) > 0.4
    assert np.ptp(height[stretched]) > 0.02


@pytest.mark.parametrize("formulation", ["cartesian-error", "joint-space"])
def test_corner_holds_two_joints_at_once_and_lets_go(formulation: str) -> None:
    made = run("limit-corner", formulation)
    assert made.scenario.watched_joints == (3, 5)
    both = np.all(made.distance[:-1][:, [3, 5]] < 1e-6, axis=1)
    assert np.mean(both) > 0.25
    assert np.min(made.distance) > -1e-12
    named = {"joint limits[3] lower", "joint limits[5] lower"}
    assert any(named <= set(active) for active in made.active)
    # Sideways the tool is free, and in the end both joints are off their limits.
    speed = np.array([np.max(np.abs(qd)) for qd in made.qd])
    sideways = both & np.array([abs(v[1]) > 0.1 for v in made.v])
    assert np.sum(sideways) > 150
    assert np.min(speed[sideways]) > 0.01
    assert np.all(made.distance[-1, [3, 5]] > np.deg2rad(0.3))


@pytest.mark.parametrize("formulation", ["cartesian-error", "joint-space"])
def test_outside_no_joint_goes_further_and_both_come_back(formulation: str) -> None:
    made = run("start-outside-limits", formulation)
    out = made.distance[:, [3, 5]]
    assert out[0] == pytest.approx(np.deg2rad([-3.0, -2.0]))
    returning = np.diff(out, axis=0)
    assert np.min(returning[out[:-1] < 0.0]) > -1e-12
    assert np.all(out[-1] > 0.0)
    # The hand pulls out first: nothing gives.
    first = 200
    assert np.max(np.abs(out[first] - out[0])) < np.deg2rad(0.1)


def test_drill_keeps_its_line() -> None:
    made = run("drill-line")
    robot, start = made.scenario.robot, made.scenario.robot.pose(made.scenario.q0)
    ways = np.array([start[:3, :3].T @ (robot.pose(q)[:3, 3] - start[:3, 3]) for q in made.q[::20]])
    # Held to first order in dt: what is left is the drift of the integration.
    assert np.max(np.abs(ways[:, :2])) < 5e-6
    assert np.max(ways[:, 2]) == pytest.approx(0.02, abs=5e-4)
    assert ways[-1, 2] == pytest.approx(0.0, abs=5e-6)
    twists = [made.scenario.guide.twist(0.2, start), made.scenario.guide.twist(0.8, start)]
    assert all(np.max(np.abs(start[:3, :3].T @ twist[:3])[:2]) > 0.04 for twist in twists)


def test_pivot_stays_where_it_is_while_the_tool_turns() -> None:
    made = run("rcm-pivot")
    robot = made.scenario.robot
    poses = [robot.pose(q) for q in made.q[::20]]
    start = poses[0]
    trocar = start[:3, 3] + PIVOT * start[:3, 2]
    # Where the tool's z passes the trocar, sideways.
    off = [np.cross(pose[:3, 2], trocar - pose[:3, 3]) for pose in poses]
    # The pivot is one point of the tool: drawn back by 2 cm it is another one, 2 cm sin(tilt) off.
    first = 20
    assert np.max(np.abs(off[:first])) < 1e-5
    tilt = [np.arccos(np.clip(pose[:3, 2] @ start[:3, 2], -1.0, 1.0)) for pose in poses]
    assert np.max(tilt) > 0.1
    drawn = (poses[-1][:3, 3] - start[:3, 3]) @ start[:3, 2]
    assert drawn < -0.015


@pytest.mark.parametrize("formulation", ["cartesian-error", "damped"])
def test_drilling_is_led_turned_and_pushed(formulation: str) -> None:
    made = run("drilling", formulation)
    robot = made.scenario.robot
    assert robot.tip == "drill_tip"
    assert [str(mode) for mode in made.scenario.modes] == ["fix-orientation", "rcm:-0.06", "line:z"]
    turning, pushing = (int(np.argmax(made.phase == k)) for k in (1, 2))
    # The hand rests where the mode changes, and the arm does too.
    for k in (turning, pushing):
        assert np.max(np.abs(made.qd[k - 1 : k + 1])) < 1e-3
    poses = [robot.pose(q) for q in made.q]
    led = poses[turning][:3, 3] - poses[0][:3, 3]
    assert np.linalg.norm(led) == pytest.approx(0.15 * np.linalg.norm([0.15, -0.06, -0.05]), rel=0.05)
    assert np.max(np.abs(poses[turning][:3, :3] - poses[0][:3, :3])) < 1e-5
    # Wrist 3 slides onto the limit that its cable sets, is held there, and comes off again.
    on = np.array(["joint limits[5] upper" in active for active in made.active])
    assert set(made.phase[on]) == {1}
    assert 0.1 < np.mean(on) < 0.2
    assert np.min(made.distance[:, 5]) < 1e-6
    assert np.min(made.distance) > -1e-12
    assert not on[pushing - 1]
    # Until then the shaft turns about the entry.
    entry = poses[turning][:3, 3] - INSERTED * poses[turning][:3, 2]
    free = range(turning, int(np.argmax(on)))
    assert max(np.linalg.norm(np.cross(poses[k][:3, 2], entry - poses[k][:3, 3])) for k in free) < 1e-4
    tilt = np.arccos(poses[pushing][:3, 2] @ poses[turning][:3, 2])
    assert np.rad2deg(tilt) > 3.0
    start = poses[pushing]
    ways = np.array([start[:3, :3].T @ (pose[:3, 3] - start[:3, 3]) for pose in poses[pushing:]])
    assert np.max(np.abs(ways[:, :2])) < 5e-6
    assert ways[-1, 2] == pytest.approx(0.015, rel=0.05)


def test_drill_is_kept_off_the_arm() -> None:
    """Capsules of the UR5e and of the drill, which ends at the tool centre point."""
    robot = drilling_robot()
    pairs = drill_self_collision().checked_pairs(robot)
    assert len(pairs) == len(capsule_model("ur5e").pairs) + 8
    (bit,) = {capsule for pair in pairs for capsule in pair if capsule.name == "bit"}
    q = np.deg2rad(START_DEG)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    assert data.oMi[bit.link].act(np.array(bit.end)) == pytest.approx(robot.pose(q)[:3, 3], abs=1e-12)


def test_modes_are_switched_while_the_hand_pulls() -> None:
    made = run("mode-switch")
    assert [str(mode) for mode in made.scenario.modes] == ["fix-orientation", "fix-position", "line:z"]
    second = int(np.argmax(made.phase == 2))
    assert np.linalg.norm(made.v[second - 1]) > 0.4
    # What moved the tool about its tip is stopped at once: the new mode locks it.
    jump = np.abs(made.qd[second] - made.qd[second - 1]) / made.scenario.dt
    assert np.max(jump) > 5.0 * np.max(made.scenario.robot.qdd_max)
    assert np.max(np.abs(made.qd)) == pytest.approx(CAREFUL, abs=1e-12)
    assert any("joint limits" in name for active in made.active for name in active)


def test_random_states_are_near_limits_and_could_occur() -> None:
    scenario = get_scenario("random-states")
    states, robot = scenario.states, scenario.robot
    assert states is not None
    distance = np.minimum(robot.q_max - states.q, states.q - robot.q_min)
    assert np.min(distance) > 0.9 * NEAR[0]
    assert np.mean(distance <= NEAR[1]) == pytest.approx(0.4, abs=0.03)
    ahead = np.where(states.qd_prev > 0, robot.q_max - states.q, states.q - robot.q_min)
    for k in range(0, len(ahead), 50):
        fastest = np.array(viable_bound(ahead[k], robot.qd_max, robot.qdd_max, scenario.dt)).ravel()
        assert np.all(np.abs(states.qd_prev[k]) <= fastest * (1 + 1e-12))
    again, other = get_scenario("random-states"), get_scenario("random-states(seed=1)")
    assert again.states is not None
    assert other.states is not None
    assert np.array_equal(again.states.q, states.q)
    assert not np.any(other.states.q == states.q)
    step = compile_step(robot, "cartesian-error", states.mode)
    batch = step.batch(states.q, states.v)
    assert set(batch.status) == {Status.SOLVED}
    assert np.mean(batch.iterations > 0) > 0.3
    assert np.max(batch.iterations) >= 3
    with pytest.raises(ValueError, match="count of at least 1"):
        get_scenario("random-states(count=0)")


def test_infeasible_is_so_by_the_triangle_inequality() -> None:
    scenario = get_scenario("infeasible")
    states = scenario.states
    assert states is not None
    assert scenario.expects is Status.PRIMAL_INFEASIBLE
    rows = np.array([
        (states.mode.twist_map_at(scenario.robot.pose(q)) @ scenario.robot.jacobian(q))[list(states.mode.fixed_rows)]
        for q in states.q
    ])  # fmt: skip
    reachable = np.abs(rows).sum(axis=2) * SLOWEST
    assert np.max(reachable) < CORRECTION
    assert np.asarray(scenario.inputs["qd_max"]).max() == SLOWEST


@pytest.mark.parametrize("formulation", available_formulations())
def test_infeasible_gets_a_certificate_from_every_formulation(formulation: str) -> None:
    scenario = get_scenario("infeasible")
    states = scenario.states
    assert states is not None
    step = make_step(scenario.robot, formulation, states.mode, "active-set")
    for k in range(3):
        remembered = {"qd_prev": states.qd_prev[k]} if "qd_prev" in step.inputs else {}
        result = step(states.q[k], states.v[k], dt=scenario.dt, **scenario.inputs, **remembered)
        assert result.status is Status.PRIMAL_INFEASIBLE


def test_infeasible_is_infeasible_for_want_of_speed_alone() -> None:
    scenario = get_scenario("infeasible")
    states = scenario.states
    assert states is not None
    step = compile_step(scenario.robot, "joint-space", states.mode)
    given = {**scenario.inputs, "qd_max": np.full(scenario.robot.nv, 10.0)}
    assert step(states.q[0], states.v[0], **given).status is Status.SOLVED
    assert step(states.q[0], states.v[0], **scenario.inputs).status is Status.PRIMAL_INFEASIBLE
