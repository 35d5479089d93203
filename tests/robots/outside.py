"""Stands in for a package outside this library that brings its own robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinqp.robots import DhRow, Robot, robot_from_dh

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

NOT_CALLABLE = 3


def slider(*, tip: str | None, qdd_max: ArrayLike | None) -> Robot:
    row = DhRow(name="slide", kind="prismatic", q_min=0.0, q_max=1.0, qd_max=0.5, tau_max=20.0)
    return robot_from_dh("slider", [row], tip=tip or "end", qdd_max=qdd_max)


def not_a_robot(*, tip: str | None, qdd_max: ArrayLike | None) -> str:
    return f"{tip} {qdd_max!r}"
