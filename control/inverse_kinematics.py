"""
Inverse kinematics within joint limits, by steps of the same QPs that move the arm.

One step is a QP of `joint-space` over a period of one second: the hand asks for the whole remaining error as a
velocity, the joints may move as far as their position limits and the trust region let them, and the trust region
follows how well the linearised kinematics predicted the error. How fast a joint may be is no part of the question.
With the QP's box this is the Gauss-Newton method with box-shaped trust regions (Nocedal and Wright, "Numerical
Optimization", 2006, section 10.3): quadratic near a solution, and where none exists it ends in a
point that no small motion within the limits improves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
import pinocchio as pin

from ..formulations import JointSpace, Mode, ModeError
from ..robots import finite_vector, real_array
from ..solvers import Status
from .ik_result import IkResult, IkStatus
from .joint_ranges import largest_steps, spread_starts
from .step import make_step

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..robots import Robot

    Array = NDArray[np.float64]

# One second, so that a velocity is a step; its limit is then the trust region's, whatever the robot's is.
_PERIOD: Final = 1.0
# The bound of `viable` is then the distance to the limit: no braking distance within one period.
_ACCELERATION: Final = 1e9
# Of the square of the largest step; small enough for quadratic convergence, large enough for the QP to be curved.
_JOINT_WEIGHT: Final = 1e-9
# Of the cost, below which its predicted decrease counts as none: joints then stand still to about 1e-6.
_STALLED: Final = 1e-12
# How much nearer another start must end for the first to be given up [m].
_NEARER: Final = 1e-7
_SMALLEST_TRUST: Final = 1e-9
# A step that keeps less than this share of its promise shrinks the trust region, one that keeps more widens it.
_POOR, _GOOD = 0.25, 0.75


@dataclass(frozen=True, eq=False)
class _Descent:
    history: list[Array]
    cost: float
    status: IkStatus


class InverseKinematics:
    """Inverse kinematics of a robot in a mode; make it once for many targets.

    Parameters
    ----------
    robot : Robot
    mode : str or Mode
        What the target is about. `position`: the tool centre point, and orientation is left alone. `free`: the full
        pose. Any other: the full pose too, of which the locked rows stay those of the start:
        `fix-orientation` goes to the target's position, `line:z` to the point of the line that is nearest to it.
    solver : str
        Any solver's name.
    tolerance, angle_tolerance : float
        What counts as reached [m, rad].
    length : float
        What an error of one radian counts as, against errors of position [m]: for poses out of reach.
    max_steps : int
        Steps per start.
    starts : int
        Number of starts at most, the given one included; the others are spread over the joint ranges.
    seed : int
        Of the other starts: same input, same result.

    Raises
    ------
    ModeError
        For `rcm`, whose target is not a pose of the tool centre point.
    ValueError
        Naming an option out of range.
    """

    def __init__(
        self,
        robot: Robot,
        mode: str | Mode = "position",
        *,
        solver: str = "active-set",
        tolerance: float = 1e-10,
        angle_tolerance: float = 1e-9,
        length: float = 0.3,
        max_steps: int = 100,
        starts: int = 16,
        seed: int = 0,
    ) -> None:
        positive = {"tolerance": tolerance, "angle_tolerance": angle_tolerance, "length": length}
        for name, value in (positive | {"max_steps": max_steps, "starts": starts}).items():
            if not 0 < value < np.inf:
                raise ValueError(f"{name}: expected a positive number, got {value}")
        self.robot: Final = robot
        self.mode: Final = Mode.parse(mode) if isinstance(mode, str) else mode
        if self.mode.depth:
            raise ModeError(f"mode: inverse kinematics expected a mode about the tool centre point, got {self.mode}")
        self._full: Final = self.mode.m_free + self.mode.m_fixed == 6
        self._tolerance: Final = tolerance
        self._angle_tolerance: Final = angle_tolerance
        self._weight: Final = np.array([1.0] * 3 + [length**2] * 3)[: 6 if self._full else 3]
        self._max_steps: Final = max_steps
        self._step: Final = make_step(
            robot, JointSpace(), Mode.free() if self._full else Mode.position(), solver=solver
        )
        self._reach: Final = largest_steps(robot)
        self._starts: Final = spread_starts(robot, starts - 1, seed)

    def __call__(
        self, target: ArrayLike, q0: ArrayLike, *, only: bool = False, max_steps: int | None = None
    ) -> IkResult:
        """Find joint positions.

        Parameters
        ----------
        target : array_like, shape (3,) or (4, 4)
            Position [m], or homogeneous pose, in the robot's base frame. A position will do where the mode locks
            orientation or leaves it alone.
        q0 : array_like, shape (nv,)
            First start [rad or m]. Beyond limits it is moved to them first; that is not counted as a step.
        only : bool
            Make no other start.
        max_steps : int, optional
            Steps per start; as of the constructor, if left out.

        Raises
        ------
        ValueError
            When an input has the wrong shape, is not finite, or is no pose.
        """
        first = np.clip(finite_vector("q0", q0, self.robot.nv), self.robot.q_min, self.robot.q_max)
        goal = self._goal(target, self.robot.pose(first))
        descents: list[_Descent] = []
        for start in (first, *(() if only else self._starts)):
            descents.append(self._descend(start, goal, max_steps or self._max_steps))
            if descents[-1].status is IkStatus.REACHED:
                break
        best = _best(descents)
        q = best.history[-1]
        e = self._error(q, goal)
        return IkResult(
            q=q,
            status=best.status,
            error=float(np.linalg.norm(e[:3])),
            angle=float(np.linalg.norm(e[3:])),
            steps=len(best.history) - 1,
            total_steps=sum(len(descent.history) - 1 for descent in descents),
            starts=len(descents),
            start=descents.index(best),
            history=np.array(best.history),
        )

    @property
    def position_only(self) -> bool:
        """Whether the target is a position, and orientation is left alone."""
        return not self._full

    def _descend(self, q: Array, goal: Array, max_steps: int) -> _Descent:
        """Step until the target is reached or no step helps."""
        e = self._error(q, goal)
        cost = 0.5 * float(e @ (self._weight * e))
        history, trust = [q], 1.0
        for _ in range(max_steps):
            if self._reached(e):
                return _Descent(history, cost, IkStatus.REACHED)
            result = self._step(
                q,
                e,
                dt=_PERIOD,
                qd_max=trust * self._reach,
                qdd_max=np.full(self.robot.nv, _ACCELERATION),
                task_weight=self._weight,
                joint_weight=_JOINT_WEIGHT / self._reach**2,
            )
            promised = cost - 0.5 * float(result.eps @ (self._weight * result.eps))
            if result.status is not Status.SOLVED:
                trust *= 0.5
            elif promised <= _STALLED * cost or trust < _SMALLEST_TRUST:
                return _Descent(history, cost, IkStatus.NEAREST)
            else:
                there = np.clip(q + result.qd, self.robot.q_min, self.robot.q_max)
                e_there = self._error(there, goal)
                cost_there = 0.5 * float(e_there @ (self._weight * e_there))
                kept = (cost - cost_there) / promised
                if kept < _POOR:
                    trust *= 0.25
                elif kept > _GOOD:
                    trust = min(2.0 * trust, 1.0)
                if cost_there < cost:
                    q, e, cost = there, e_there, cost_there
            history.append(q)
        return _Descent(history, cost, IkStatus.REACHED if self._reached(e) else IkStatus.MAX_STEPS)

    def _reached(self, e: Array) -> bool:
        position, angle = np.linalg.norm(e[:3]), np.linalg.norm(e[3:])
        return bool(position <= self._tolerance and angle <= self._angle_tolerance)

    def _error(self, q: Array, goal: Array) -> Array:
        """Displacement from the pose at `q` to the goal, world axes: (3,) or (6,) [m, rad]."""
        twist = _displacement(self.robot.pose(q), goal)
        return twist if self._full else twist[:3]

    def _goal(self, target: ArrayLike, start: Array) -> Array:
        """Pose to go to, (4, 4), with the rows that the mode locks left at the start."""
        given = real_array("target", target)
        if given.shape not in ((3,), (4, 4)) or not np.isfinite(given).all():
            raise ValueError(f"target: expected 3 coordinates or a (4, 4) pose, all finite, got {target!r}")
        pose = start.copy()
        if given.shape == (3,):
            if not {3, 4, 5}.isdisjoint(self.mode.free_rows):
                raise ValueError(f"target: expected a (4, 4) pose for mode {self.mode}, got a position")
            pose[:3, 3] = given
        else:
            rotation = given[:3, :3]
            proper = np.allclose(rotation @ rotation.T, np.eye(3), rtol=0.0, atol=1e-6) and np.linalg.det(rotation) > 0
            if not proper or not np.array_equal(given[3], [0.0, 0.0, 0.0, 1.0]):
                raise ValueError(f"target: expected a homogeneous pose with a rotation matrix, got {target!r}")
            pose = given
        if not self.mode.fixed_rows:
            return pose
        to_mode = self.mode.twist_map_at(start)
        along = to_mode @ _displacement(start, pose)
        along[list(self.mode.fixed_rows)] = 0.0
        moved = to_mode.T @ along
        goal = start.copy()
        goal[:3, 3] += moved[:3]
        goal[:3, :3] = pin.exp3(moved[3:]) @ start[:3, :3]
        return goal


def _best(descents: list[_Descent]) -> _Descent:
    """The descent that reached the target, or else the first that is as near as any, which stays close to `q0`."""
    if descents[-1].status is IkStatus.REACHED:
        return descents[-1]
    remaining = np.sqrt([2.0 * descent.cost for descent in descents])
    return descents[int(np.argmax(remaining <= remaining.min() + _NEARER))]


def _displacement(pose: Array, goal: Array) -> Array:
    """Translation and rotation vector from one pose to another, world axes, shape (6,) [m, rad]."""
    turn = pin.log3(goal[:3, :3] @ pose[:3, :3].T)
    return np.concatenate([goal[:3, 3] - pose[:3, 3], turn])


def inverse_kinematics(
    robot: Robot, target: ArrayLike, q0: ArrayLike, mode: str | Mode = "position", **options: float | str
) -> IkResult:
    """Find joint positions within the limits at which the tool is at, or nearest to, a target.

    Parameters
    ----------
    robot : Robot
        Any.
    target : array_like, shape (3,) or (4, 4)
        Position [m], or homogeneous pose, in the base frame.
    q0 : array_like, shape (nv,)
        First start, within the limits or not [rad or m].
    mode : str or Mode
        `position`, `free` for the full pose, or any other mode that moves the tool centre point.
    **options
        As of `InverseKinematics`, which is the one to make for many targets.

    Returns
    -------
    IkResult

    Raises
    ------
    ModeError
        For `rcm`.
    ValueError
        When an input has the wrong shape, is not finite, or is no pose.
    """
    return InverseKinematics(robot, mode, **options)(target, q0)  # type: ignore[arg-type]  # options are checked there
