"""The closed loop: state, QP, command, integration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..formulations import DEFAULT_DT, InputError
from ..robots import real_array
from .checks import checked_period
from .last_command import LastCommand, is_stop

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Input, Mode
    from ..robots import Robot
    from ..solvers import Status

    Array = NDArray[np.float64]


class Command(Protocol):
    """What every control cycle gives, interpreted or compiled."""

    @property
    def qd(self) -> Array:
        """Joint velocity command, shape (nv,) [rad/s or m/s]."""

    @property
    def eps(self) -> Array:
        """Cartesian error, shape (m_free,) [m/s, rad/s]."""

    @property
    def status(self) -> Status:
        """SOLVED, or why the command is the safe stop."""

    @property
    def iterations(self) -> int | None:
        """As the solver counts them; None where it tells none."""

    @property
    def active(self) -> tuple[str, ...]:
        """Rows that hold the command back."""


class AnyStep(Protocol):
    """A control cycle: interpreted, of a baseline (`make_step` makes both), or compiled (`compile_step`)."""

    @property
    def robot(self) -> Robot:
        """The arm."""

    @property
    def mode(self) -> Mode:
        """The motion mode."""

    @property
    def specs(self) -> tuple[Input, ...]:
        """What a call takes: `q`, `v` and the run-time inputs."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what a call takes by keyword beyond the state and the twist."""

    def __call__(self, q: ArrayLike, v: ArrayLike, **inputs: ArrayLike) -> Command:
        """Give the command at a state."""


class Guide(Protocol):
    """Who guides the tool: a path follower, an operator."""

    def twist(self, t: float, pose: Array) -> Array:
        """Twist asked for at time `t` [s] with the tool at `pose` (4, 4): shape (6,), world axes [m/s, rad/s]."""


@dataclass(frozen=True)
class Trajectory:
    """A closed-loop run, one entry per tick.

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time [s].
    q : ndarray, shape (N, nv)
        State before the command [rad or m].
    v : ndarray, shape (N, m_free)
        Velocity asked for, along the mode's axes [m/s, rad/s].
    qd : ndarray, shape (N, nv)
        Command [rad/s or m/s].
    position : ndarray, shape (N, 3)
        Tool centre point [m].
    eps : ndarray, shape (N, m_free)
        Cartesian error [m/s, rad/s].
    status : tuple of Status
    iterations : ndarray of int, shape (N,)
        -1 where the solver tells none.
    active : tuple of tuple of str
        Names of the rows that held the command back.
    fixed_error, bound_violation, sigma_min, setup_time, solve_time : ndarray, shape (N,)
        As in `StepResult`; NaN of a compiled step, which tells none of them.
    message : tuple of str
        As in `StepResult`; empty of a compiled step.
    q_end : ndarray, shape (nv,)
        State after the last command [rad or m].
    """

    t: Array
    q: Array
    v: Array
    qd: Array
    position: Array
    eps: Array
    status: tuple[Status, ...]
    iterations: NDArray[np.int64]
    active: tuple[tuple[str, ...], ...]
    fixed_error: Array
    bound_violation: Array
    sigma_min: Array
    setup_time: Array
    solve_time: Array
    message: tuple[str, ...]
    q_end: Array

    def acceleration(self) -> Array:
        """Joint accelerations by differences of the commands, from rest, shape (N, nv) [rad/s^2 or m/s^2]."""
        dt = self.t[1] - self.t[0]
        acceleration: Array = np.diff(self.qd, axis=0, prepend=0.0) / dt
        return acceleration


def simulate(
    step: AnyStep,
    guide: Guide,
    q0: ArrayLike,
    duration: float,
    *,
    dt: float = DEFAULT_DT,
    on_tick: Callable[[int, int], None] | None = None,
) -> Trajectory:
    """Run the closed loop: ask the guide, compute the command, integrate it exactly over one period.

    A tick whose QP fails sends the safe stop, and the run goes on: the failure is in the result.

    Parameters
    ----------
    step : InterpretedStep, BaselineStep or CompiledStep
        The controller; `dt` is handed to it at every tick and, where it takes them, the last command as `qd_prev` and
        its difference from the one before over `dt` as `qdd_prev`: zero at the start, where the arm is at rest, and
        after a safe stop, whose acceleration is not one to go on with.
    guide : Guide
        Gives the twist asked for.
    q0 : array_like, shape (nv,)
        Start [rad or m].
    duration : float
        [s].
    dt : float
        Control period, 1e-5 to 1 [s].
    on_tick : callable, optional
        Called with (ticks done, ticks in all) after every tick.

    Returns
    -------
    Trajectory

    Raises
    ------
    ValueError
        Naming the input that is not usable.
    """
    dt = checked_period(dt)
    ticks = round(duration / dt) if np.isfinite(duration) else 0
    if ticks < 2:
        raise ValueError(f"duration: expected at least two periods of {dt:g} s, got {duration}")
    free = list(step.mode.free_rows)
    q = real_array("q0", q0, InputError).copy()
    last = LastCommand(step.robot.nv, dt)
    states: list[Array] = []
    twists: list[Array] = []
    positions: list[Array] = []
    results: list[Command] = []
    for tick in range(ticks):
        pose = step.robot.pose(q)
        v = (step.mode.twist_map_at(pose) @ guide.twist(tick * dt, pose))[free]
        result = step(q, v, dt=dt, **last.inputs(step))
        states.append(q)
        twists.append(v)
        positions.append(pose[:3, 3])
        results.append(result)
        last.sent(result.qd, stop=is_stop(step, result.status))
        q = q + dt * result.qd
        if on_tick is not None:
            on_tick(tick + 1, ticks)
    return Trajectory(
        t=np.arange(ticks, dtype=np.float64) * dt,
        q=np.array(states),
        v=np.array(twists),
        qd=np.array([result.qd for result in results]),
        position=np.array(positions),
        eps=np.array([result.eps for result in results]),
        status=tuple(result.status for result in results),
        iterations=np.array([-1 if result.iterations is None else result.iterations for result in results]),
        active=tuple(result.active for result in results),
        fixed_error=_told(results, "fixed_error"),
        bound_violation=_told(results, "bound_violation"),
        sigma_min=_told(results, "sigma_min"),
        setup_time=_told(results, "setup_time"),
        solve_time=_told(results, "solve_time"),
        message=tuple(getattr(result, "message", "") for result in results),
        q_end=q,
    )


def _told(results: list[Command], name: str) -> Array:
    """One figure of every tick, NaN where the step doesn't tell it."""
    return np.array([getattr(result, name, np.nan) for result in results], dtype=np.float64)
