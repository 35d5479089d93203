"""Commands that rounding of the state explains, and wrong ones that it doesn't."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinqp.benchmarks.invariants import Row, States, arm
from kinqp.benchmarks.invariants.rounding import commands_around, judge_rounding, within
from kinqp.control import InterpretedStep, make_step
from kinqp.formulations import Mode, get_formulation
from tests.codegen.compiled import compiled

if TYPE_CHECKING:
    from kinqp.benchmarks.invariants.states import StateSet

MODE = "plane:1,-2,0.5"
# Of the locked rows' singular values one is 1.1e-9 here: one unit in the last place of a row turns what they leave by
# 1e-7, times a hand of 2 km/s.
ALMOST_DEPENDENT = [
    -2.665805147e-08,
    2.648188994e-08,
    4.330062779e-09,
    -2.738614545e-08,
    9.455560999e-10,
    -1.686981880e-08,
]
HAND = [-195.168544729, -2132.347307617]


@pytest.fixture(scope="module")
def step() -> InterpretedStep:
    return make_step(arm("ur5e"), get_formulation("cartesian-error"), MODE)


@pytest.fixture(scope="module")
def states() -> StateSet:
    """The state at which rounding decides is number 2; the others are anywhere."""
    some = States(arm("ur5e"), Mode.parse(MODE), 3).take(9)
    q, v = some.q.copy(), some.v.copy()
    q[2], v[2] = ALMOST_DEPENDENT, HAND
    return dataclasses.replace(some, q=q, v=v)


def test_within_is_a_range_and_as_much_beyond() -> None:
    commands = np.array([[0.0, 1.0], [0.2, 1.0]])
    assert within(np.array([0.1, 1.0]), commands)
    assert within(np.array([-0.19, 1.0]), commands)
    assert within(np.array([0.39, 1.0 + 0.9e-9]), commands)
    assert not within(np.array([0.41, 1.0]), commands)
    assert not within(np.array([-0.21, 1.0]), commands)
    # A joint that rounding doesn't move is where it is.
    assert not within(np.array([0.1, 1.0 + 1e-6]), commands)
    assert not within(np.array([0.1, 1.0]), commands[:0])
    assert not within(np.array([np.nan, 1.0]), commands)


def test_a_compiled_command_where_rounding_decides(step: InterpretedStep, states: StateSet) -> None:
    around = commands_around(step, states, 2, {})
    wide = np.ptp(around, axis=0)
    assert 1e-4 < wide.max() < 0.1
    command = compiled("ur5e", "cartesian-error", MODE, quick=True)(states.q[2], states.v[2]).qd
    assert within(command, around)
    for wrong in (command + 3.0 * wide, command - 3.0 * wide, 0.9 * command, -command, np.zeros(6)):
        assert not within(wrong, around)
    # The fourth joint is on its bound, whatever the rounding.
    assert not within(command - np.eye(6)[3] * 1e-6, around)


def test_where_a_state_says_what_is_right_nothing_else_passes(step: InterpretedStep, states: StateSet) -> None:
    around = commands_around(step, states, 0, {})
    command = step(states.q[0], states.v[0]).qd
    assert np.ptp(around, axis=0).max() < 1e-9
    assert within(command, around)
    for joint in np.eye(6):
        assert not within(command + 1e-6 * joint, around)


def test_what_is_left_unexplained_breaks_an_invariant(step: InterpretedStep, states: StateSet) -> None:
    result = compiled("ur5e", "cartesian-error", MODE, quick=True).batch(states.q, states.v)
    row = Row(formulation="cartesian-error", robot="ur5e", mode=MODE, solver="active-set in C")
    looked_at = np.arange(9) <= 2
    judge_rounding(row, step, states, {}, result.qd, looked_at)
    assert not row.violations
    wrong = result.qd.copy()
    wrong[:4] += 0.2  # the fourth isn't looked at
    row = Row(formulation="cartesian-error", robot="ur5e", mode=MODE, solver="active-set in C")
    judge_rounding(row, step, states, {}, wrong, looked_at)
    assert row.violations["unexplained"].count == 3
    assert sum(row.notes.values()) == 0
