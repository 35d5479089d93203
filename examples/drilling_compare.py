"""The task of drilling.py with other controllers, and what drift correction does when it can't be followed.

First the same minutes of leading, turning and drilling, one line for each controller. Then an arm that slips by 2 mm
while joint velocities are turned down so far that no joint could follow the correction: the correction has to give way,
not the mode, and must not make the problem infeasible.

    python examples/drilling_compare.py                # a few minutes
    python examples/drilling_compare.py --seconds 5
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
from drilling import (
    DECELERATION,
    DRILL,
    MARGIN,
    ROBOT,
    TURN,
    WEIGHT,
    Array,
    drill,
    make_controller,
    make_steps,
    measure,
)

from kinqp.benchmarks.scenarios.drilling import INSERTED, START_DEG
from kinqp.formulations import DEFAULT_DT, Mode
from kinqp.solvers import Status

ROWS = (
    "turning: shaft off the entry",
    "drilling: tip off the line",
    "drilling: tool turned by",
    "capsules closer than the margin by",
    "joint acceleration",
    "ticks not solved",
    "turning: tip from the entry, most",
    "drilling: way of the tip along the line",
    "least power of the hand on the tool",
)
SLOW = 0.002  # all joints [rad/s]
SLIP = 2e-3  # sideways [m]


def compare(seconds: float) -> None:
    """Print a column for each controller."""
    controllers = {
        "as it is": make_controller("joint-space-robust"),
        "no correction": make_controller("joint-space-robust", correct=False),
        "joint-space": make_controller("joint-space"),
        "damped": make_controller("damped"),
        "damped, step": make_controller("damped", approach="step"),
    }
    tables = [{row.what: row for row in measure(drill(controller, seconds))} for controller in controllers.values()]
    print(f"{f'{seconds:g} s each':50}" + "".join(f"{name:>15}" for name in controllers))
    for what in ROWS:
        print(f"{what:41} {tables[0][what].unit:8}" + "".join(f"{table[what].value:>15.3g}" for table in tables))


def tick_times() -> None:
    """Print how long a tick in C takes, over the states of a run: the best of seven rounds of all its states."""
    print("\nA tick in C, from state and velocity to command [us]:")
    for formulation in ("joint-space-robust", "joint-space", "damped"):
        drilled = drill(make_controller(formulation), 10.0)
        run, times = drilled.run, []
        for step, name in zip(make_steps(formulation), ("leading", "turning", "drilling"), strict=True):
            ticks = drilled.ticks(step.mode)[2:]
            given: dict[str, object] = {"self_collision_margin": MARGIN, "self_collision_deceleration": DECELERATION}
            if "remote_centre_pivot" in step.inputs:
                given["remote_centre_pivot"] = drilled.entry
                given |= {"task_weight": WEIGHT} if "task_weight" in step.inputs else {}
            if "qd_prev" in step.inputs:
                given["qd_prev"] = run.qd[ticks - 1]
            if "qdd_prev" in step.inputs:
                given["qdd_prev"] = (run.qd[ticks - 1] - run.qd[ticks - 2]) / DEFAULT_DT
            best = np.inf
            for _ in range(7):
                start = time.perf_counter()
                step.batch(run.q[ticks], run.v[ticks][:, list(step.mode.free_rows)], **given)
                best = min(best, time.perf_counter() - start)
            times.append(f"{name} {1e6 * best / len(ticks):5.2f}")
        print(f"  {formulation:20}" + "   ".join(times))


def slip(mode: Mode) -> bool:
    """Let the arm slip sideways with its joints turned down, then give them their speed back; print how far off it is.

    Return whether the mode held all the time: every tick solved, never further off, and back in the end.
    """
    controller, q = make_controller("joint-space-robust"), np.deg2rad(START_DEG)
    start = ROBOT.pose(q)
    entry = start[:3, 3] - INSERTED * start[:3, 2]
    controller.set(TURN, remote_centre_pivot=entry)
    controller.set(qd_max=SLOW)
    controller.engage(mode)
    while controller.mode != mode:
        controller(q, np.zeros(6))
    controller(q, np.zeros(6))  # anchored
    q = q + np.linalg.pinv(ROBOT.jacobian(q)) @ np.concatenate([SLIP * start[:3, 0], np.zeros(3)])

    def off(q: Array) -> float:
        pose = ROBOT.pose(q)
        across = start[:3, :2].T @ (pose[:3, 3] - start[:3, 3]), pose[:3, :2].T @ (entry - pose[:3, 3])
        return float(np.linalg.norm(across[0 if mode == DRILL else 1]))

    print(f"\n{mode}: slipped by {1e3 * SLIP:g} mm; the hand pushes with 15 N")
    solved, way = True, [off(q)]
    for label, limit in ((f"at most {SLOW:g} rad/s", np.full(ROBOT.nv, SLOW)), ("at full speed", ROBOT.qd_max)):
        controller.set(qd_max=limit)
        yielded = 0
        for _ in range(1500):
            result = controller(q, np.concatenate([15.0 * ROBOT.pose(q)[:3, 2], np.zeros(3)]))
            q = q + controller.dt * result.qd
            solved &= result.status is Status.SOLVED
            yielded += result.yielded
            way.append(off(q))
        print(f"  joints {label:20} 1.5 s later {1e3 * way[-1]:7.4f} mm off; given up wholly at {yielded} ticks")
    growth = float(np.max(np.diff(way)))
    print(f"  all ticks solved: {solved}; never further off by more than {1e9 * growth:.2g} nm in a tick")
    return solved and growth < 1e-7 and way[-1] < 2e-5


def main(arguments: list[str] | None = None) -> int:
    """Run from the command line; return the exit code."""
    parser = argparse.ArgumentParser(description="Drilling with other controllers, and after a slip.")
    parser.add_argument("--seconds", type=float, default=60.0, help="of turning, and of drilling")
    compare(parser.parse_args(arguments).seconds)
    tick_times()
    return 0 if all([slip(DRILL), slip(TURN)]) else 1


if __name__ == "__main__":
    sys.exit(main())
