"""Work against the hand, and what the arm could have done instead."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from kinqp.benchmarks import Block, Cell, States, SweepConfig, cell_record, get_scenario
from kinqp.benchmarks.accuracy import PreparedBlock
from kinqp.benchmarks.metrics import Ticks
from kinqp.formulations import Mode

from .hand_made import scenario, ticks_frame

ROBOT = get_scenario("semicircle").robot
REST = np.deg2rad([10.0, 40.0, 20.0, -80.0, 30.0, 60.0, 0.0])
PULL = np.array([0.1, 0.0, 0.0])
DT = 1e-3


def hand(ticks: int, **columns: Any) -> dict[str, Any]:
    frame = ticks_frame(ticks, **{"q": np.tile(REST, (ticks, 1)), "v": np.tile(PULL, (ticks, 1)), **columns})
    return cell_record(frame, None, scenario(ticks)).flat()


def moving(velocities: np.ndarray) -> np.ndarray:
    """Joint velocities that give the tool these linear ones, its orientation kept, shape (N, 7)."""
    return np.array([np.linalg.pinv(ROBOT.jacobian(REST)) @ np.concatenate([v, np.zeros(3)]) for v in velocities])


def test_slow_sideways_and_at_rest_is_not_against() -> None:
    # Half of it, none, all of it sideways, twice as fast; the hand at rest and the tool not; rounding.
    eps = np.array([-0.5 * PULL, -PULL, [-0.1, 0.3, 0.0], PULL, [-0.05, 0.0, 0.0], -PULL * (1.0 + 1e-13)])
    v = np.tile(PULL, (6, 1))
    v[4] = 0.0
    found = hand(6, v=v, eps=eps)
    assert found["against"] == 0
    assert found["against_speed"] == found["against_share"] == 0.0


def test_what_is_against_is_counted_with_its_speed() -> None:
    made = np.array([[-0.02, 0.5, 0.0], [-0.03, 0.0, 0.0], [0.1, 0.0, 0.0]])
    found = hand(3, eps=made - PULL, qd=moving(made))
    assert found["against"] == found["against_choice"] == 2
    assert found["against_speed"] == pytest.approx(0.03)
    assert found["against_share"] == pytest.approx(0.3)
    assert found["against_limit"] == found["against_slowing"] == found["against_stop"] == 0


def test_braking_is_told_from_going_back() -> None:
    """The hand turns around: braked gently, then as hard as a joint can, and then gone back on purpose."""
    fastest = float(np.max(np.abs(moving(PULL[None]))))
    hard = 10.0 * DT / fastest  # of `PULL`, what a tick takes off with a joint at its acceleration limit
    scale = np.array([-3.0 * hard, -2.9 * hard, -1.9 * hard, -2.0 * hard, 0.5])
    made, v = scale[:, None] * PULL, np.tile(PULL, (5, 1))
    v[0] = -PULL
    found = hand(5, v=v, eps=made - v, qd=moving(made))
    assert (ROBOT.qdd_max == 10.0).all()
    assert found["against"] == 3
    assert (found["against_slowing"], found["against_limit"], found["against_choice"]) == (1, 1, 1)


def test_stops_and_corrections_have_their_own_columns() -> None:
    made = np.tile([-0.01, 0.0, 0.0], (3, 1))
    stopped = hand(3, eps=made - PULL, qd=moving(made), status=["solved", "failed", "solved"])
    assert (stopped["against"], stopped["against_stop"], stopped["against_choice"]) == (3, 1, 2)
    frame = ticks_frame(3, q=np.tile(REST, (3, 1)), v=np.tile(PULL, (3, 1)), eps=made - PULL, qd=moving(made))
    corrected = replace(scenario(3), inputs={"v_fixed": [0.0, 0.1, 0.0]})
    record = cell_record(frame, None, corrected).flat()
    assert (record["against"], record["against_correction"], record["against_choice"]) == (3, 3, 0)


def test_of_states_the_last_command_is_the_given_one_and_of_samples_it_is_not_known() -> None:
    made = np.tile([-0.01, 0.0, 0.0], (2, 1))
    states = States(Mode.fix_orientation(), np.tile(REST, (2, 1)), moving(2.0 * made), np.tile(PULL, (2, 1)))
    frame = ticks_frame(2, q=states.q, v=states.v, eps=made - PULL, qd=moving(made))
    record = cell_record(frame, None, replace(scenario(2), phases=(), states=states)).flat()
    assert record["against_choice"] == 0
    assert record["against_limit"] + record["against_slowing"] == 2
    sampled = cell_record(frame, None, scenario(30)).flat()
    assert sampled["loop"] == "sampled"
    assert (sampled["against"], sampled["against_choice"], sampled["against_slowing"]) == (2, None, None)


@pytest.mark.parametrize("name", ["limit-corner", "random-states"])
def test_joint_space_never_works_against_the_hand(name: str) -> None:
    """Zero is admissible, so that v . (v + eps) >= |v + eps|^2 + qd' W_q qd at its minimum, with unit task weight."""
    block = PreparedBlock(Block(name, "joint-space"), SweepConfig(timing_ticks=1))
    frame, _ = block.run(Cell(name, "joint-space", "active-set"))
    ticks = Ticks(get_scenario(name), frame)
    made = ticks.v + ticks.eps
    left = np.einsum("ti,ti->t", ticks.v, made) - np.einsum("ti,ti->t", made, made)
    assert (left >= 1e-4 * np.einsum("ti,ti->t", ticks.qd, ticks.qd) - 1e-10).all()
    assert cell_record(frame, None, ticks.scenario).flat()["against"] == 0


def test_the_least_error_is_that_of_another_solver() -> None:
    """cvxpy with Clarabel on the same question, bounds found by bisection, at states near limits."""
    whole = get_scenario("random-states")
    assert whole.states is not None
    count = 60
    states = States(whole.states.mode, whole.states.q[:count], whole.states.qd_prev[:count], whole.states.v[:count])
    frame = ticks_frame(count, q=states.q, v=states.v, eps=-states.v)
    possible = Ticks(replace(whole, states=states), frame).possible
    assert possible.tick.tolist() == [k for k in range(0, count, 10) if np.linalg.norm(states.v[k]) > 1e-3]
    for tick, lost, moved in zip(possible.tick, possible.lost, possible.moved, strict=True):
        q, v = states.q[tick], states.v[tick]
        J, qd = ROBOT.jacobian(q), cp.Variable(7)
        high, low = (
            np.array([_fastest(distance, most) for distance, most in zip(room, ROBOT.qd_max, strict=True)])
            for room in (ROBOT.q_max - q, q - ROBOT.q_min)
        )
        problem = cp.Problem(cp.Minimize(cp.sum_squares(J[:3] @ qd - v)), [J[3:] @ qd == 0, qd <= high, qd >= -low])
        problem.solve(solver="CLARABEL")
        motion = J[:3] @ qd.value
        # The frame's tool stands still.
        assert lost == pytest.approx(motion @ v / (v @ v), abs=2e-3)
        assert moved == pytest.approx(np.linalg.norm(motion), abs=2e-3 * np.linalg.norm(v) + 1e-6)


def _fastest(distance: float, most: float) -> float:
    """By bisection: the fastest that stops within a distance, losing 10 rad/s^2 in steps of 1 ms."""
    low, high = 0.0, float(most)
    for _ in range(60):
        middle = 0.5 * (low + high)
        way = np.sum(np.maximum(middle - 1e-2 * np.arange(300), 0.0)) * DT
        low, high = (middle, high) if way <= distance else (low, middle)
    return low
