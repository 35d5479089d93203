"""The closed loop with a hand in it: hand, admittance, command, motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..robots import real_array

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Mode
    from ..robots import Robot
    from ..solvers import Status
    from .compiled_guiding import CompiledGuiding
    from .guiding import GuidingController
    from .guiding_result import GuidingPhase, GuidingResult

    Array = NDArray[np.float64]


class Hand(Protocol):
    """Who holds the tool."""

    def wrench(self, t: float, pose: Array, twist: Array) -> Array:
        """Force and torque on the tool at the tool centre point, shape (6,), world axes [N, N m].

        Parameters
        ----------
        t : float
            Time [s].
        pose : ndarray, shape (4, 4)
            Where the tool is [m].
        twist : ndarray, shape (6,)
            How it moves, world axes [m/s, rad/s].
        """

    def finished(self, t: float) -> bool:
        """Tell whether the hand is done at time `t` [s]: the run ends."""

    def reset(self) -> None:
        """Begin again."""


@dataclass(frozen=True)
class GuidedRun:
    """A run with a hand in the loop, one entry per tick.

    Attributes
    ----------
    robot : Robot
    dt : float
        Control period [s].
    t : ndarray, shape (N,)
        Time [s].
    q, qd : ndarray, shape (N, nv)
        State before the command, and the command [rad or m; .../s].
    position : ndarray, shape (N, 3)
        Tool centre point, world [m].
    rotation : ndarray, shape (N, 3, 3)
        The tool's axes as columns, world.
    wrench : ndarray, shape (N, 6)
        Of the hand on the tool, world axes [N, N m].
    twist : ndarray, shape (N, 6)
        Of the tool under the command, world axes [m/s, rad/s].
    v, v_actual : ndarray, shape (N, 6)
        Asked for by the admittance, and given, along the six rows of the mode; `v` is zero where a row is not guided
        [m/s, rad/s].
    status, mode, phase, active : tuple
        As in `GuidingResult`.
    iterations : ndarray of int, shape (N,)
        -1 where the solver tells none.
    drift : ndarray, shape (N, 2)
        Distance and angle of the locked rows from where the mode was engaged [m, rad].
    yielded : ndarray of bool, shape (N,)
        Where the drift compensation gave way.
    q_end : ndarray, shape (nv,)
        State after the last command.
    """

    robot: Robot
    dt: float
    t: Array
    q: Array
    qd: Array
    position: Array
    rotation: Array
    wrench: Array
    twist: Array
    v: Array
    v_actual: Array
    status: tuple[Status, ...]
    mode: tuple[Mode, ...]
    phase: tuple[GuidingPhase, ...]
    active: tuple[tuple[str, ...], ...]
    iterations: NDArray[np.int64]
    drift: Array
    yielded: NDArray[np.bool_]
    q_end: Array

    def acceleration(self) -> Array:
        """Joint accelerations by differences of the commands, from rest, shape (N, nv) [rad/s^2 or m/s^2]."""
        acceleration: Array = np.diff(self.qd, axis=0, prepend=0.0) / self.dt
        return acceleration

    def power(self) -> Array:
        """Power of the hand on the tool, shape (N,) [W]; negative where the tool moves against it."""
        power: Array = np.sum(self.wrench * self.twist, axis=1)
        return power


def simulate_guiding(
    controller: GuidingController | CompiledGuiding,
    hand: Hand,
    q0: ArrayLike,
    duration: float,
    *,
    schedule: Sequence[tuple[float, Callable[[Any], object]]] = (),
    on_tick: Callable[[int, int], None] | None = None,
) -> GuidedRun:
    """Run a controller with a hand on the tool; commands are integrated exactly over one period.

    Parameters
    ----------
    controller : GuidingController or CompiledGuiding
        From rest: it is reset first.
    hand : Hand
        Reset first, too.
    q0 : array_like, shape (nv,)
        Start [rad or m].
    duration : float
        At most this long [s]; the hand may end the run before.
    schedule : sequence of (float, callable)
        What is done with the controller on the way, and when [s]: ``[(2.0, lambda c: c.engage("line:z"))]``.
    on_tick : callable, optional
        Called with (ticks done, ticks at most) after every tick.

    Returns
    -------
    GuidedRun

    Raises
    ------
    ValueError
        Naming the input that is not usable.
    """
    dt = controller.dt
    ticks = round(duration / dt) if np.isfinite(duration) else 0
    if ticks < 2:
        raise ValueError(f"duration: expected at least two periods of {dt:g} s, got {duration}")
    due = sorted(schedule, key=lambda entry: entry[0])
    controller.reset()
    hand.reset()
    robot = controller.robot
    q = real_array("q0", q0).copy()
    if q.shape != (robot.nv,) or not np.isfinite(q).all():
        raise ValueError(f"q0: expected {robot.nv} finite numbers, got {q0!r}")
    record = _Record(robot, dt, ticks)
    qd = np.zeros(robot.nv)
    for tick in range(ticks):
        t = tick * dt
        # Half a period of slack, since times are sums of periods.
        while due and due[0][0] <= t + 0.5 * dt:
            due.pop(0)[1](controller)
        pose, jacobian = robot.pose(q), robot.jacobian(q)
        wrench = hand.wrench(t, pose, jacobian @ qd)
        result = controller(q, wrench)
        qd = result.qd
        record.put(tick, q, pose, wrench, jacobian @ qd, result)
        q = q + dt * qd
        if on_tick is not None:
            on_tick(tick + 1, ticks)
        if hand.finished(t + dt):
            break
    return record.run(q)


class _Record:
    """Arrays that are filled tick by tick: twice as fast as lists of arrays."""

    def __init__(self, robot: Robot, dt: float, ticks: int) -> None:
        self._robot, self._dt = robot, dt
        shapes = {"q": (robot.nv,), "qd": (robot.nv,), "position": (3,), "rotation": (3, 3), "wrench": (6,)}
        shapes |= {"twist": (6,), "v": (6,), "v_actual": (6,), "drift": (2,)}
        self._arrays = {name: np.zeros((ticks, *shape)) for name, shape in shapes.items()}
        self._results: list[GuidingResult] = []

    def put(self, tick: int, q: Array, pose: Array, wrench: Array, twist: Array, result: GuidingResult) -> None:
        """Take down one tick."""
        arrays, mode = self._arrays, result.mode
        arrays["q"][tick] = q
        arrays["qd"][tick] = result.qd
        arrays["position"][tick] = pose[:3, 3]
        arrays["rotation"][tick] = pose[:3, :3]
        arrays["wrench"][tick] = wrench
        arrays["twist"][tick] = twist
        arrays["v"][tick, mode.free_rows] = result.v
        arrays["v_actual"][tick] = mode.twist_map_at(pose) @ twist
        arrays["drift"][tick] = result.drift
        self._results.append(result)

    def run(self, q_end: Array) -> GuidedRun:
        """Make the run of what was taken down."""
        results = self._results
        count = len(results)
        return GuidedRun(
            robot=self._robot,
            dt=self._dt,
            t=np.arange(count, dtype=np.float64) * self._dt,
            status=tuple(result.status for result in results),
            mode=tuple(result.mode for result in results),
            phase=tuple(result.phase for result in results),
            active=tuple(result.active for result in results),
            iterations=np.array([-1 if r.iterations is None else r.iterations for r in results], dtype=np.int64),
            yielded=np.array([result.yielded for result in results]),
            q_end=q_end,
            **{name: values[:count] for name, values in self._arrays.items()},
        )
