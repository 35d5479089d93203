"""Formulations beside each other on singular paths: ``python -m kinqp.benchmarks.singular``.

Each closed loop runs the compiled step at 1 kHz; the tables are those of docs/singularities.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from rich.console import Console
from rich.progress import track

from ..codegen import compile_step
from ..control import PositionObserver
from ..control.last_command import LastCommand, is_stop
from ..formulations import DEFAULT_DT
from ..robots import load_robot
from ..solvers import Status
from .conditions import conditions
from .least_acceleration import unforced_excess
from .metrics.motion import sign_changes
from .scenarios.disturbances import DISTURBANCES, Disturbance
from .scenarios.singular import ROBOT, SingularPath, hard_paths, singular_paths

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..codegen import CompiledStep
    from ..formulations import Mode
    from ..robots import Robot
    from .scenarios.random_paths import RandomPath

    Array = NDArray[np.float64]

_ONLY: Final = "damping={}, pull={}, rate_limit={}, smoothing={}, governor={}, jerk=false"
# By what they are called in the tables.
VARIANTS: Final = {
    "plain joint-space": "joint-space",
    "damped": f"joint-space-robust({_ONLY.format('true', 'false', 'false', 'false', 'false')})",
    "rate limit": f"joint-space-robust({_ONLY.format('false', 'false', 'true', 'false', 'false')})",
    "damped, pull": f"joint-space-robust({_ONLY.format('true', 'true', 'false', 'false', 'false')})",
    "damped, pull, rate limit": f"joint-space-robust({_ONLY.format('true', 'true', 'true', 'false', 'false')})",
    "without jerk limit": "joint-space-robust(jerk=false)",
    "joint-space-robust": "joint-space-robust",
    "plain cartesian-error": "cartesian-error",
    "cartesian-error-robust": "cartesian-error-robust",
}


@dataclass(frozen=True)
class SingularRow:
    """One formulation on one path.

    Attributes
    ----------
    formulation, path, disturbance : str
    sigma_min : float
        Smallest singular value of J_bar met [m or rad].
    peak_speed, peak_acceleration : float
        Of all joints and ticks, as shares of `qd_max` and `qdd_max`; of the command.
    chatter : float
        Sign changes of a joint's acceleration from one tick to the next with both sides above `CHATTER_SHARE` of its
        limit, summed over joints, per second.
    task_error : float
        Mean norm of the Cartesian error [m/s].
    fixed_error : float
        Largest |J_fixed qd| at the positions that the step was given [m/s, rad/s].
    true_error : float
        Largest |J_fixed dq/dt| of the arm's motion where it really was [m/s, rad/s].
    lost : float
        Time that the tool is behind the hand in the end: the way not made along the pull over its speed [s]. Beyond
        its reach the arm can't but lose time.
    failed : int
        Ticks that ended in the safe stop.
    unforced : float
        Largest share of `qdd_max` by which the acceleration of a tick was beyond both the limit and the least that the
        locked rows and the limits of position and velocity left at that tick (`least_acceleration`).
    """

    formulation: str
    path: str
    disturbance: str
    sigma_min: float
    peak_speed: float
    peak_acceleration: float
    chatter: float
    task_error: float
    fixed_error: float
    true_error: float
    lost: float
    failed: int
    unforced: float = 0.0


def singular_run(
    step: CompiledStep, path: SingularPath | RandomPath, disturbance: Disturbance, *, name: str = "", every: int = 5
) -> SingularRow:
    """Run one closed loop and sum it up.

    Parameters
    ----------
    step : CompiledStep
        For the path's robot, in its mode.
    path : SingularPath or RandomPath
    disturbance : Disturbance
        Its noise is drawn from a fixed seed.
    name : str
        What to call the formulation.
    every : int
        Take singular values at every so many-th tick.
    """
    robot, mode, dt = step.robot, step.mode, DEFAULT_DT
    free, fixed = list(mode.free_rows), list(mode.fixed_rows)
    rng = np.random.default_rng(0)
    given: dict[str, Array] = {"q_max": robot.q_max.copy()}
    for joint, angle in path.q_max_deg.items():
        given["q_max"][joint] = np.deg2rad(angle)
    last = LastCommand(robot.nv, dt)
    observe = PositionObserver(robot.nv, disturbance.observer_gain, dt)
    q, moved = path.q0, np.zeros(robot.nv)
    follow = 1.0 - np.exp(-dt / disturbance.lag) if disturbance.lag > 0.0 else 1.0
    commands, errors, wishes = [], [], []
    sigma, fixed_error, true_error, failed, unforced = np.inf, 0.0, 0.0, 0, 0.0
    for tick in range(round(path.duration(disturbance.speed) / dt)):
        seen = observe(q + disturbance.noise * rng.normal(size=robot.nv), last.qd)
        v = path.twist(tick * dt, disturbance.speed)[free]
        result = step(seen, v, **given, **last.inputs(step))
        failed += result.status is not Status.SOLVED
        rows = _rows(robot, mode, seen)[fixed]
        limits = robot.q_min, given["q_max"], robot.qd_max, robot.qdd_max
        unforced = max(unforced, unforced_excess(rows, seen, (last.qd, result.qd), limits, dt))
        last.sent(result.qd, stop=is_stop(step, result.status))
        qd = result.qd
        fixed_error = max(fixed_error, float(np.max(np.abs(rows @ qd), initial=0.0)))
        if tick % every == 0:
            sigma = min(sigma, _sigma_min(robot, mode, q))
        commands.append(qd)
        errors.append(result.eps)
        wishes.append(v)
        moved = moved + follow * (qd - moved)
        true_error = max(true_error, float(np.max(np.abs(_rows(robot, mode, q)[fixed] @ moved), initial=0.0)))
        q = q + dt * moved
    return _summary(
        (name or step.formulation.name, path.name, disturbance.name), robot, np.array(commands), np.array(errors),
        np.array(wishes), (sigma, fixed_error, true_error, failed, unforced),
    )  # fmt: skip


def _summary(
    names: tuple[str, str, str],
    robot: Robot,
    qd: Array,
    eps: Array,
    v: Array,
    seen: tuple[float, float, float, int, float],
) -> SingularRow:
    acceleration = np.diff(qd, axis=0, prepend=0.0) / DEFAULT_DT / robot.qdd_max
    speed = np.linalg.norm(v, axis=1)
    moving = speed > 1e-3
    behind = -np.sum(eps[moving] * v[moving], axis=1) / speed[moving]
    sigma, fixed_error, true_error, failed, unforced = seen
    return SingularRow(
        *names,
        sigma_min=sigma,
        peak_speed=float(np.max(np.abs(qd) / robot.qd_max)),
        peak_acceleration=float(np.max(np.abs(acceleration))),
        chatter=sign_changes(acceleration) / (len(qd) * DEFAULT_DT),
        task_error=float(np.mean(np.linalg.norm(eps, axis=1))),
        fixed_error=fixed_error,
        true_error=true_error,
        lost=float(np.sum(behind) * DEFAULT_DT / np.max(speed)),
        failed=failed,
        unforced=unforced,
    )


def _rows(robot: Robot, mode: Mode, q: Array) -> Array:
    rows: Array = mode.twist_map_at(robot.pose(q)) @ robot.jacobian(q)
    return rows


def _sigma_min(robot: Robot, mode: Mode, q: Array) -> float:
    rows = _rows(robot, mode, q)
    guided = rows[list(mode.free_rows)]
    if mode.m_fixed:
        _, sigma, Vt = np.linalg.svd(rows[list(mode.fixed_rows)])
        basis = Vt[: int(np.sum(sigma > 1e-9 * sigma[0]))]
        guided = guided - guided @ basis.T @ basis
    return float(np.linalg.svd(guided, compute_uv=False)[-1])


def singular_sweep(
    formulations: Sequence[str],
    paths: Sequence[SingularPath],
    disturbances: Sequence[Disturbance] = (Disturbance(),),
) -> list[SingularRow]:
    """Run every formulation on every path with every disturbance.

    Parameters
    ----------
    formulations : sequence of str
        Keys of `VARIANTS`, or anything that `get_formulation` takes by name.
    paths : sequence of SingularPath
    disturbances : sequence of Disturbance
    """
    robot = load_robot(ROBOT)
    cells = [(name, path) for name in formulations for path in paths]
    steps: dict[tuple[str, str], CompiledStep] = {}
    rows = []
    for name, path in track(cells, "closed loops", transient=True):
        key = name, path.mode
        if key not in steps:
            steps[key] = compile_step(robot, VARIANTS.get(name, name), path.mode)
        rows += [singular_run(steps[key], path, disturbance, name=name) for disturbance in disturbances]
    return rows


def to_markdown(rows: Sequence[SingularRow]) -> str:
    """Write rows as a Markdown table."""
    head = (
        "path", "with", "formulation", "sigma_min", "peak qd/max", "peak qdd/max", "chatter [1/s]", "error [m/s]",
        "locked rows", "really", "lost [s]", "failed",
    )  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    lines += [
        f"| {row.path} | {row.disturbance} | {row.formulation} | {row.sigma_min:.4f} | {row.peak_speed:.2f} | "
        f"{row.peak_acceleration:.2f} | {row.chatter:.2f} | {row.task_error:.4f} | {row.fixed_error:.0e} | "
        f"{row.true_error:.0e} | {row.lost:.2f} | {row.failed} |"
        for row in sorted(rows, key=lambda row: (row.disturbance, row.path))
    ]
    return "\n".join(lines)


def main() -> None:
    """Print the tables and the conditions."""
    console = Console(soft_wrap=True)
    robust = ("joint-space-robust", "cartesian-error-robust")
    tables = {
        "The sweep": (tuple(VARIANTS), singular_paths(), (Disturbance(),)),
        "Limits and other modes": (("plain joint-space", *robust), hard_paths(), (Disturbance(),)),
        "Disturbed": (robust, (*singular_paths(), *hard_paths()), DISTURBANCES),
    }
    for title, arguments in tables.items():
        rows = singular_sweep(*arguments)
        console.print(f"## {title}\n\n{to_markdown(rows)}\n", markup=False, highlight=False)
    console.print("; ".join(f"{k} {v}" for k, v in conditions().items()) + ".", markup=False, highlight=False)


if __name__ == "__main__":
    main()
