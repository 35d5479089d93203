"""An LBR Med guided by hand: two modes, a switch while the hand pulls, a velocity limit lowered on the way.

    python examples/hand_guiding.py

The hand is a force that comes and goes. The admittance makes a velocity of it, the QP makes joint velocities of that:
the orientation is locked at first, then all but the tool's z. Whatever is asked for on the way, no joint exceeds its
acceleration limit by more than rounding, and the tool comes to rest before its mode changes.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from kinqp.control import GuidingPhase, make_guiding, simulate_guiding
from kinqp.robots import load_robot
from kinqp.solvers import Status

ROBOT = load_robot("lbr_med14")
START = np.deg2rad([0.0, 30.0, 0.0, -70.0, 0.0, 80.0, 0.0])
SWITCH, LOWER, END = 3.0, 4.5, 6.0  # when [s]
CAREFUL = 0.02  # what all joints are lowered to [rad/s]


class Hand:
    """Pulls forwards and to the side, then down."""

    def wrench(self, t, pose, twist):
        """Force and torque on the tool at time t [s], world axes [N, N m]; a real hand would look at pose and twist."""
        del pose, twist
        grip = min(t / 0.5, 1.0, (END - t) / 0.5)  # nobody pulls with full force at once
        force = grip * np.array([4.0, 5.0, -2.0] if t < SWITCH else [2.0, 3.0, -6.0])
        return np.concatenate([force, np.zeros(3)])

    def finished(self, t):
        """Let go of the tool at the end only."""
        return t >= END

    def reset(self):
        """Nothing is remembered."""


def main(arguments: list[str] | None = None) -> int:
    """Guide the arm, print what it does, and check what the text above says."""
    parser = argparse.ArgumentParser(description="An LBR Med guided by hand.")
    parser.add_argument("--solver", help="name of one to interpret the ticks with; compiled C unless told otherwise")
    chosen = parser.parse_args(arguments)
    how = {"solver": chosen.solver} if chosen.solver else {"compiled": True}
    controller = make_guiding(ROBOT, "joint-space-robust", ["fix-orientation", "line:z"], **how)
    schedule = [
        (SWITCH, lambda c: c.engage("line:z")),
        (LOWER, lambda c: c.set(qd_max=CAREFUL)),
    ]
    run = simulate_guiding(controller, Hand(), START, END, schedule=schedule)

    print("  t [s]  mode             phase     hand [N]  tool [mm/s]  fastest joint [rad/s]  drift [um]")
    for k in range(0, len(run.t), 250):
        pull, speed = np.linalg.norm(run.wrench[k, :3]), 1e3 * np.linalg.norm(run.twist[k, :3])
        print(
            f"{run.t[k]:7.2f}  {run.mode[k]!s:15}  {run.phase[k].value:8}  {pull:8.1f}  {speed:11.1f}"
            f"  {np.abs(run.qd[k]).max():21.4f}  {1e6 * run.drift[k, 0]:10.2f}"
        )
    acceleration = (np.abs(run.acceleration()) / ROBOT.qdd_max).max()
    guided = [k for k, phase in enumerate(run.phase) if phase is GuidingPhase.GUIDING]
    agreement = np.sum(run.v * run.v_actual, axis=1)[guided].min()
    unsolved = sum(status is not Status.SOLVED for status in run.status)
    print(f"largest joint acceleration: {acceleration:.4f} of the limit; ticks not solved: {unsolved}")
    print(f"velocity asked for times velocity given: never below {agreement:.2g}")
    slow = np.abs(run.qd[run.t > LOWER + 0.5]).max() <= CAREFUL + 1e-8
    return 0 if acceleration < 1.0 + 1e-6 and unsolved == 0 and slow else 1


if __name__ == "__main__":
    sys.exit(main())
