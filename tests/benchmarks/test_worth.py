"""What a compiled command is worth: right ones pass however far apart, worse ones and those outside are named."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from kinqp.benchmarks.invariants import Row, States, arm
from kinqp.benchmarks.invariants.worth import TOLERANCE, judge_worth, worth
from kinqp.control import make_step
from kinqp.formulations import Instance, JointSpace, Mode, get_formulation
from kinqp.solvers import QP
from tests.codegen.compiled import compiled

MODE = "fix-orientation"


def instance(qp: QP, K: Any) -> Instance:
    """A problem of our own: only what the judgement reads is real."""
    step = make_step(arm("lbr_med14"), JointSpace(), MODE)
    K = np.array(K, dtype=float)
    return dataclasses.replace(step.evaluate(np.zeros(7), np.zeros(3)), qp=qp, K=K, k=np.zeros(len(K)))


def test_a_direction_that_costs_nothing_is_free() -> None:
    # minimise 1/2 x^2 over (x, y), |y| <= 1: any y will do.
    flat = instance(QP(H=np.diag([1.0, 0.0]), g=[0.0, 0.0], lb=[-1.0, -1.0], ub=[1.0, 1.0]), np.eye(2))
    answer = np.zeros(2)
    assert worth(flat, answer, np.array([0.0, 0.9])) == (0.0, 0.0)
    outside, above = worth(flat, answer, np.array([0.0, 1.0 + 1e-6]))
    assert outside == pytest.approx(1e-6, rel=1e-3)
    assert above == 0.0
    # By hand: 1/2 0.1^2 above, relative to itself and 1e-9.
    outside, above = worth(flat, answer, np.array([0.1, 0.0]))
    assert outside == 0.0
    assert above == pytest.approx(1.0, rel=1e-6)


def test_where_nothing_is_asked_and_nothing_costs() -> None:
    idle = instance(QP(H=np.zeros((1, 1)), g=[0.0], lb=[-1.0], ub=[1.0]), [[1.0]])
    assert worth(idle, np.zeros(1), np.zeros(1)) == (0.0, 0.0)


def test_the_error_that_goes_with_a_command_is_recovered() -> None:
    # eps = qd - 1, cost 1/2 eps^2, |qd| <= 0.5: at best qd = 0.5.
    qp = QP(H=np.diag([1.0, 0.0]), g=[0.0, 0.0], A=[[1.0, -1.0]], b=[-1.0], lb=[-np.inf, -0.5], ub=[np.inf, 0.5])
    one = instance(qp, [[0.0, 1.0]])
    answer = np.array([-0.5, 0.5])
    assert worth(one, answer, np.array([0.5])) == (0.0, 0.0)
    outside, above = worth(one, answer, np.array([0.4]))
    assert outside <= 1e-12
    # By hand: (0.6^2 - 0.5^2) / 2 over the larger cost 0.18 and what a move by 1 costs, 0.5.
    assert above == pytest.approx(0.055 / 0.68, rel=1e-6)
    assert worth(one, answer, np.array([0.6]))[0] == pytest.approx(0.1, rel=1e-3)


def test_what_a_command_leaves_open_is_chosen_well() -> None:
    # qd = up - down, both from 0 on, as in joint-space-weighted: the parts of a command are not its halves.
    qp = QP(H=np.eye(2), g=[-1.0, -1.0], lb=[0.0, 0.0], ub=[1.0, 1.0])
    one = instance(qp, [[1.0, -1.0]])
    # The answer is (1, 1), command 0; command 0.5 is best with (1, 0.5): 1/8 above, over the terms 1 and 2 at (1, 1).
    outside, above = worth(one, np.ones(2), np.array([0.5]))
    assert outside <= TOLERANCE
    assert above == pytest.approx(0.125 / 3.0, rel=1e-6)


@pytest.mark.parametrize("name", ["cartesian-error", "joint-space-weighted", "hierarchical"])
def test_compiled_commands_are_worth_the_interpreted_ones(name: str) -> None:
    states = States(arm("lbr_med14"), Mode.parse(MODE), 1).take(40)
    step = make_step(arm("lbr_med14"), get_formulation(name), MODE)
    made = compiled("lbr_med14", name, MODE, quick=True)
    result = made.batch(states.q, states.v)
    row = Row(formulation=name, robot="lbr_med14", mode=MODE, solver="active-set in C")
    judge_worth(row, step, states, {}, (result.qd, result.codes), np.zeros(40, dtype=bool))
    assert not row.violations
    # A tenth of every motion given away keeps all rows but one that asks for it, and costs.
    slower = 0.9 * result.qd
    judge_worth(row, step, states, {}, (slower, result.codes), np.ones(40, dtype=bool))
    assert row.violations
    assert {"compiled rows", "compiled cost"} >= set(row.violations)
    assert sum(one.count for one in row.violations.values()) > 10
    beyond = result.qd + 1e-6 * (1.0 + np.abs(result.qd).max(axis=1, keepdims=True))
    row = Row(formulation=name, robot="lbr_med14", mode=MODE, solver="active-set in C")
    judge_worth(row, step, states, {}, (beyond, result.codes), np.ones(40, dtype=bool))
    assert row.violations["compiled rows"].count > 10
    assert row.notes["parity or apart broken, and worth as much"] < 30
