"""A guided run as a table and back: one row per tick."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import polars as pl

from ...control import GuidedRun, GuidingPhase
from ...formulations import Mode
from ...robots import load_robot
from ...solvers import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_ARRAYS: Final = ("q", "qd", "position", "wrench", "twist", "v", "v_actual", "drift")


def frame_of(run: GuidedRun, torque: Array) -> pl.DataFrame:
    """Return a run, and its joint torques of shape (N, nv) [Nm], as a frame.

    Columns are the fields of `GuidedRun`, arrays as fixed-size lists (`rotation` row by row, 9 entries), and `torque`.
    """
    columns: dict[str, Any] = {"t": run.t}
    for name in _ARRAYS:
        columns[name] = np.ascontiguousarray(getattr(run, name))
    columns["rotation"] = np.ascontiguousarray(run.rotation.reshape(-1, 9))
    columns["torque"] = np.ascontiguousarray(torque)
    columns |= {
        "status": [status.value for status in run.status],
        "mode": [str(mode) for mode in run.mode],
        "phase": [phase.value for phase in run.phase],
        "active": pl.Series([list(names) for names in run.active], dtype=pl.List(pl.String)),
        "iterations": run.iterations,
        "yielded": run.yielded,
    }
    return pl.DataFrame(columns)


def run_of(frame: pl.DataFrame, robot: str, dt: float, q_end: Array) -> GuidedRun:
    """Make the run again of its frame, its robot's name, its control period [s] and its last state [rad]."""
    modes = {name: Mode.parse(name) for name in frame["mode"].unique()}
    return GuidedRun(
        t=frame["t"].to_numpy(),
        rotation=frame["rotation"].to_numpy().reshape(-1, 3, 3),
        status=tuple(Status(value) for value in frame["status"]),
        mode=tuple(modes[name] for name in frame["mode"]),
        phase=tuple(GuidingPhase(value) for value in frame["phase"]),
        active=tuple(tuple(names) for names in frame["active"].to_list()),
        iterations=frame["iterations"].to_numpy(),
        yielded=frame["yielded"].to_numpy(),
        dt=dt,
        robot=load_robot(robot),
        q_end=q_end,
        **{name: frame[name].to_numpy() for name in _ARRAYS},
    )


def torque_of(frame: pl.DataFrame) -> Array:
    """Return the joint torques, shape (N, nv) [Nm]."""
    torque: Array = frame["torque"].to_numpy()
    return torque
