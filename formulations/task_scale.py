"""The task's direction kept, its speed given up only as far as need be: what the scaled formulations share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal, get_args

import casadi as ca

from .algebra import dot, matmul

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

Task = Literal["scaled", "hard"]
TASKS: Final[tuple[str, ...]] = get_args(Task)
# Only keeps the direction of a zero velocity finite: far below any speed, far above where squares underflow.
_NO_SPEED: Final = 1e-100


def check_task(task: str) -> None:
    """Refuse a word that is none of `TASKS`."""
    if task not in TASKS:
        raise ValueError(f"task: expected one of {', '.join(TASKS)}, got {task!r}")


def scale_threshold(tick: Tick, default: float) -> ca.SX:
    """Return the run-time parameter `scale_threshold`, the sigma_0 of `follow_scaled`, shape (1, 1) [m or rad]."""
    return tick.parameter("scale_threshold", default, lowest=0.0, positive=True, unit="m or rad")


def follow_exactly(qp: QuadraticProgram, tick: Tick, qd: ca.SX) -> None:
    """Declare the rows J_free qd = v, which limits and singularities can make infeasible."""
    qp.equal(tick.J_free @ qd, tick.v, name="task")


def follow_scaled(qp: QuadraticProgram, tick: Tick, qd: ca.SX, threshold: ca.SX) -> None:
    r"""Declare the rows J_free qd = s v with s in [0, 1], s pushed to 1, beside an objective 1/2 qd' W qd.

    The unknown is the speed that is kept, :math:`c = s\,|w|`, in the units of v:

    .. math::
        J_{free}\,\dot q - c\,w/|w| = J_{free}\,\dot q_{fixed},\quad 0 \le c \le |w|,\qquad
        \text{cost } \tfrac12\,(2\,|w| - c)^2/\sigma_0^2,\qquad w = v - J_{free}\,\dot q_{fixed}

    where :math:`\dot q_{fixed}`, zero unless drift is corrected, is the smallest motion that the locked rows ask for:
    it is what is left at s = 0, and feasible for as long as it is within the joint bounds. The cost aims at twice the
    speed asked for, so that it still pushes at s = 1: an exact penalty. With W = 1, joints that no bound holds, and
    :math:`|\dot q_1| = |w|/\sigma` the joint speed that s = 1 takes,

    .. math:: s = \min(1,\ 2\,\sigma^2/(\sigma^2 + \sigma_0^2)),\qquad |\dot q| \le |w|/\sigma_0

    nothing is lost while :math:`\sigma \ge \sigma_0`, and towards a singularity the speed fades out with the square of
    sigma, joint speeds staying finite.

    Without drift all equalities have zero on the right, so that zero motion satisfies them without rounding: joints
    that rest on a bound which the rows leave no way to leave would make the QP infeasible by it.

    Parameters
    ----------
    qp : QuadraticProgram
        Takes the variable `speed`, shape (1,) [m/s, rad/s], the rows "task" and "task speed", and the cost.
    tick : Tick
        Gives v, J_free and qd_fixed.
    qd : ca.SX, shape (nv, 1)
        Joint velocities [rad/s or m/s].
    threshold : ca.SX, scalar
        sigma_0, positive [m or rad per unit of the objective's norm].
    """
    resting = matmul(tick.J_free, tick.qd_fixed)
    wanted = tick.v - resting
    size = ca.sqrt(dot(wanted, wanted))
    speed = qp.variable("speed", 1)
    qp.minimize(speed - 2 * size, weight=1 / threshold**2, name="task speed")
    qp.equal(tick.J_free @ qd - speed * (wanted / ca.fmax(size, _NO_SPEED)), resting, name="task")
    qp.between(0, speed, size, name="task speed")
    qp.feasible(speed=0)
