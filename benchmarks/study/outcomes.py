"""What is measured of a trial: stops, time, accelerations, torques, work of the hand, distance from the path."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pinocchio as pin
from scipy.spatial import cKDTree

from ...solvers import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...control import GuidedRun, Path

    Array = NDArray[np.float64]

#: A stop: the tool is slower than this [m/s], although the hand pulls with more than this [N], for this long [s].
STILL: Final = 1e-3
PULL: Final = 3.0
LASTING: Final = 0.1
# v . v_actual above this is rounding [m^2/s^2].
_ROUNDING: Final = -1e-12
# Between points of the path that distances are measured to [m].
_SPACING: Final = 2e-4


def joint_torques(run: GuidedRun) -> Array:
    """Joint torques that the motion takes, shape (N, nv) [Nm]: M qdd + h, by pinocchio's recursive Newton-Euler.

    The motion is what was commanded, with accelerations by differences of the commands from rest. What the hand adds
    is not in it: these are the torques that the algorithms differ in.
    """
    robot = run.robot
    data = robot.model.createData()
    torques = np.empty_like(run.qd)
    for tick, (q, qd, qdd) in enumerate(zip(run.q, run.qd, run.acceleration(), strict=True)):
        torques[tick] = pin.rnea(robot.model, data, robot.to_pinocchio(q), qd, qdd)
    return torques


def stops_of(run: GuidedRun) -> tuple[int, float]:
    """How often the tool stood still although the hand pulled, and for how long in all [s]."""
    speed = np.linalg.norm(run.twist[:, :3], axis=1)
    still = (speed < STILL) & (np.linalg.norm(run.wrench[:, :3], axis=1) > PULL)
    edges = np.diff(np.concatenate(([False], still, [False])).astype(int))
    lasting = (np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)) * run.dt
    lasting = lasting[lasting >= LASTING - 0.5 * run.dt]
    return len(lasting), float(lasting.sum())


def path_error(run: GuidedRun, path: Path) -> float:
    """Distance of the tool from the path, root mean square over the ticks [m]."""
    count = max(int(np.ceil(path.length / _SPACING)), 2)
    points = np.array([path.point(s) for s in np.linspace(0.0, path.length, count)])
    distance, _ = cKDTree(points).query(run.position)
    return float(np.sqrt(np.mean(distance**2)))


def outcomes_of(run: GuidedRun, path: Path, elbow: int, *, finished: bool) -> dict[str, Any]:
    """Measure a trial: the columns of `StudyResult.trials` from `finished` on, by name.

    Parameters
    ----------
    run : GuidedRun
    path : Path
        That was to be followed.
    elbow : int
        The joint (from 0) whose limit the path leads into.
    finished : bool
        Whether the tool arrived.
    """
    acceleration = np.abs(run.acceleration())
    torques = joint_torques(run)
    stops, standing = stops_of(run)
    peak = float(acceleration.max())
    along = np.sum(run.v * run.v_actual, axis=1)
    return {
        "finished": finished,
        "time": len(run.t) * run.dt,
        "stops": stops,
        "standing": standing,
        "peak_qdd": peak,
        "peak_qdd_joint": int(np.argmax(acceleration.max(axis=0))),
        "elbow_peak_qdd": float(acceleration[:, elbow].max()),
        "rms_qdd": float(np.sqrt(np.mean(acceleration**2))),
        "peak_torque": float(np.abs(torques).max()),
        "rms_torque": float(np.sqrt(np.mean(torques**2))),
        "peak_torque_rate": float(np.abs(np.diff(torques, axis=0)).max() / run.dt),
        "work_against": float(np.maximum(-run.power(), 0.0).sum() * run.dt),
        "path_error_rms": path_error(run, path),
        "unexpected": int(np.sum(along < _ROUNDING)),
        "drift_mm": 1e3 * float(run.drift[:, 0].max()),
        "drift_deg": float(np.rad2deg(run.drift[:, 1].max())),
        "unsolved": sum(status is not Status.SOLVED for status in run.status),
    }
