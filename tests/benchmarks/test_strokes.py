"""Strokes of the hand: how far, along which axes, without jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinqp.benchmarks.scenarios.strokes import RAMP, Stroke, Strokes, pull, rest, strokes


def test_strokes_go_as_far_as_they_say() -> None:
    hand = strokes(pull((3.0, 0.0, 4.0), 0.2, 0.1), [rest(0.4)])
    t = np.arange(0.0, hand.duration, 1e-4)
    twists = np.array([hand.twist(float(x), np.eye(4)) for x in t])
    assert twists.sum(axis=0) * 1e-4 == pytest.approx([0.06, 0.0, 0.08, 0.0, 0.0, 0.0], abs=1e-6)
    assert np.max(np.linalg.norm(twists, axis=1)) == pytest.approx(0.2)
    assert not np.any(hand.twist(hand.duration + 1.0, np.eye(4)))


def test_strokes_turn_with_the_tool() -> None:
    pose = np.eye(4)
    pose[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    twist = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    middle = RAMP + 0.05
    tool = Strokes((Stroke(twist, 2 * RAMP + 0.1, "tool"),)).twist(middle, pose)
    assert tool == pytest.approx([-2.0, 1.0, 3.0, -5.0, 4.0, 6.0])
    assert Strokes((Stroke(twist, 2 * RAMP + 0.1),)).twist(middle, pose) == pytest.approx(twist)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_strokes_have_no_jumps(a: float, b: float) -> None:
    hand = strokes(pull((1.0, 0.0, 0.0), 0.2, 0.05), pull((-1.0, 0.0, 0.0), 0.2, 0.03))
    change = hand.twist(a, np.eye(4)) - hand.twist(b, np.eye(4))
    # The quintic's steepest slope is 1.875 speeds per ramp.
    assert np.max(np.abs(change)) <= 1.875 * 0.2 / RAMP * abs(a - b) + 1e-12


def test_bad_strokes_are_refused() -> None:
    with pytest.raises(ValueError, match="twist of 6 finite numbers"):
        Stroke((1.0, 2.0), 1.0)
    with pytest.raises(ValueError, match="twist of 6 finite numbers"):
        Stroke((np.nan,) * 6, 1.0)
    with pytest.raises(ValueError, match="at least two ramps"):
        replace(rest(), duration=0.1)
