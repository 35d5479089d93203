"""The states that the invariants are checked at: all kinds, the same for a seed for ever, and read back as written."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from kinqp.benchmarks.invariants import States, arm, read_rows
from kinqp.benchmarks.invariants.states import KINDS, mode_rows
from kinqp.formulations import Mode
from tests.benchmarks.judged import MODE, row, states
from tests.formulations.reference import bounds_at

if TYPE_CHECKING:
    from pathlib import Path

# Of state 8 of seed 0, the first three of each: q, v, and qd_prev as parts of its bounds.
PUBLISHED = (
    (1.5410122080874311, 1.1556775066275669, -2.073061636172432),
    (0.006625102952336968, -0.004970970179119779, -0.008267608761237147),
    (-0.0061319380679893, -0.005237446629931384, -0.009629136079424979),
)


def test_a_state_is_its_number_and_all_kinds_are_there() -> None:
    few, many = States(arm("ur5e"), Mode.parse("line:z"), 3).take(9), States(arm("ur5e"), Mode.parse("line:z"), 3)
    for index in range(9):
        kind, q, v, _ = many.draw(index)
        assert kind == few.kinds[index] == KINDS[index % 8]
        np.testing.assert_array_equal(q, few.q[index])
        np.testing.assert_array_equal(v, few.v[index])
    assert not np.array_equal(States(arm("ur5e"), Mode.parse("line:z"), 4).draw(0)[1], few.q[0])


@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e", "panda"])
def test_states_reach_what_they_are_for(robot: str) -> None:
    some = states(robot, MODE, 96)
    assert np.isfinite(some.q).all()
    on_bound = (some.qd_prev == some.low) | (some.qd_prev == some.high)
    assert ((some.qd_prev >= some.low) & (some.qd_prev <= some.high)).all()
    assert (on_bound & (some.qd_prev != 0.0)).all(axis=1).any()
    assert not some.v.any(axis=1).all()
    assert np.abs(some.v).max() > 100.0
    sigma = []
    for kind, q in zip(some.kinds, some.q, strict=True):
        if kind == "singular":
            rows = mode_rows(arm(robot), Mode.parse(MODE), q)
            whole, locked = (np.linalg.svd(x, compute_uv=False)[-1] for x in (rows, rows[3:]))
            sigma.append(min(whole, locked))
    assert sum(x < 1e-3 for x in sigma) >= len(sigma) // 2
    assert min(sigma) < 1e-7


def test_last_accelerations_are_unknown_on_their_bounds_within_and_beyond() -> None:
    some, many = States(arm("ur5e"), Mode.parse(MODE), 3), states("ur5e", MODE, 200)
    np.testing.assert_array_equal(some.take(5).qdd_prev, some.take(9).first(5).qdd_prev)
    share = np.abs(many.qdd_prev / arm("ur5e").qdd_max)
    assert not np.isnan(share).any()
    unknown, finite = np.isinf(share), np.where(np.isinf(share), 0.0, share)
    kinds = {
        "unknown": unknown.all(axis=1),
        "unknown in part": unknown.any(axis=1) & ~unknown.all(axis=1),
        "on bounds": (finite == 1.0).any(axis=1) & (finite <= 1.0).all(axis=1),
        "beyond": (finite == 3.0).any(axis=1),
        "within": (finite < 1.0).all(axis=1) & (finite > 0.0).all(axis=1),
        "none": (share == 0.0).all(axis=1),
    }
    least = {"unknown": 20, "unknown in part": 5, "on bounds": 40, "beyond": 10, "within": 30, "none": 5}
    assert {name: int(which.sum()) for name, which in kinds.items() if which.sum() < least[name]} == {}


def test_states_are_those_that_were_published() -> None:
    """What is drawn anew has a stream of its own: seed 0's states are named by number in docs/invariants.md."""
    kind, q, v, share = States(arm("lbr_med14"), Mode.parse(MODE), 0).draw(8)
    assert kind == "inside"
    np.testing.assert_allclose([q[:3], v, share[:3]], PUBLISHED, rtol=1e-15, atol=0.0)


def test_a_state_of_infinite_accelerations_is_read_back(tmp_path: Path) -> None:
    found, number = row(), int(np.flatnonzero(np.isinf(states().qdd_prev).any(axis=1))[0])
    found.check("finite", np.arange(len(states().q)) == number, 0.0, states())
    text = json.dumps([found.model_dump(mode="json")], allow_nan=False)
    (tmp_path / "blocks").mkdir()
    (tmp_path / "blocks" / "one.json").write_text(text)
    (read,) = read_rows(tmp_path)
    assert read == found
    for name in ("q", "v", "qd_prev", "qdd_prev"):
        np.testing.assert_array_equal(read.checked["finite"].state[name], getattr(states(), name)[number])


@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e"])
def test_bounds_are_those_of_exact_fractions(robot: str) -> None:
    some = states(robot, MODE, 40)
    for q, low, high in zip(some.q, some.low, some.high, strict=True):
        exact_low, exact_high = bounds_at(arm(robot), q)
        np.testing.assert_allclose(low, exact_low, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(high, exact_high, rtol=1e-9, atol=1e-12)
