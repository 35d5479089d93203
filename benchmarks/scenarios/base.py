"""What a scenario is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...solvers import Status

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from ...control import Guide
    from ...formulations import Mode
    from ...robots import Robot

    Array = NDArray[np.float64]

#: What may be declared as the right answer of a scenario's QPs.
EXPECTED = (Status.SOLVED, Status.PRIMAL_INFEASIBLE)


class ScenarioError(ValueError):
    """A scenario is declared in a way that can't be run; the message names it and the field."""


@dataclass(frozen=True)
class Phase:
    """A stretch of a scenario in one mode.

    Attributes
    ----------
    mode : Mode
        Motion mode.
    guide : Guide
        Who guides the tool; its time counts from the beginning of the phase [s].
    duration : float
        [s].
    """

    mode: Mode
    guide: Guide
    duration: float


@dataclass(frozen=True)
class States:
    """States that have nothing to do with each other: no closed loop.

    Attributes
    ----------
    mode : Mode
        Motion mode of all of them.
    q : ndarray, shape (N, nv)
        Joint positions [rad or m].
    qd_prev : ndarray, shape (N, nv)
        Last commands, for formulations that take them [rad/s or m/s].
    v : ndarray, shape (N, m_free)
        Velocities asked for, along the mode's axes [m/s, rad/s].
    """

    mode: Mode
    q: Array
    qd_prev: Array
    v: Array


@dataclass(frozen=True)
class Scenario:
    """A job for any controller: phases of a closed loop, one after the other, or states one by one.

    Attributes
    ----------
    name, description : str
        As listed.
    robot : Robot
        The arm.
    q0 : ndarray, shape (nv,)
        Start of the closed loop, from rest [rad or m].
    dt : float
        Control period [s].
    phases : tuple of Phase
        Run one after the other: state and last command go on from one to the next. Empty where there are `states`.
    watched_joints : tuple of int
        The joints (from 0) whose limits the scenario is about.
    expects : Status
        The right answer: SOLVED, or PRIMAL_INFEASIBLE where a certificate is what is asked for.
    inputs : mapping of str to array_like
        Run-time inputs for the whole run, such as narrower limits, by name.
    states : States, optional
        In place of phases.

    Raises
    ------
    ScenarioError
        When neither or both of phases and states are given, or a shape, time or joint is impossible.
    """

    name: str
    description: str
    robot: Robot
    q0: Array
    dt: float
    phases: tuple[Phase, ...] = ()
    watched_joints: tuple[int, ...] = ()
    expects: Status = Status.SOLVED
    inputs: Mapping[str, ArrayLike] = field(default_factory=dict)
    states: States | None = None

    def __post_init__(self) -> None:
        nv = self.robot.nv
        if bool(self.phases) == (self.states is not None):
            raise ScenarioError(f"scenario {self.name!r}: expected either phases or states, got both or neither")
        if np.shape(self.q0) != (nv,):
            raise ScenarioError(f"scenario {self.name!r}: q0: expected shape ({nv},), got {np.shape(self.q0)}")
        if not self.dt > 0.0:
            raise ScenarioError(f"scenario {self.name!r}: dt: expected a positive period [s], got {self.dt}")
        for phase in self.phases:
            if not (np.isfinite(phase.duration) and round(phase.duration / self.dt) >= 1):
                raise ScenarioError(
                    f"scenario {self.name!r}: expected phases of at least one period of {self.dt:g} s, "
                    f"got {phase.duration}"
                )
        for joint in self.watched_joints:
            if not 0 <= joint < nv:
                raise ScenarioError(f"scenario {self.name!r}: expected joints from 0 to {nv - 1}, got {joint}")
        if self.expects not in EXPECTED:
            raise ScenarioError(f"scenario {self.name!r}: expects: expected one of {EXPECTED}, got {self.expects!r}")
        if self.states is not None:
            _check_states(self.name, self.states, nv)

    def limit(self, name: str) -> Array:
        """Return `q_min`, `q_max`, `qd_max` or `qdd_max` of the run: its own where `inputs` has one, else the robot's.

        Everything that measures a run by its limits takes them from here.

        Returns
        -------
        ndarray, shape (nv,)
            [rad or m, and per second].
        """
        given: ArrayLike = self.inputs.get(name, getattr(self.robot, name))
        value: Array = np.broadcast_to(np.asarray(given, dtype=np.float64), (self.robot.nv,))
        return value

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Its motion modes, each once, in order."""
        if self.states is not None:
            return (self.states.mode,)
        return tuple(dict.fromkeys(phase.mode for phase in self.phases))

    @property
    def duration(self) -> float:
        """Length of the run [s]; of states: as many periods as there are."""
        return self.ticks * self.dt

    @property
    def ticks(self) -> int:
        """How many control cycles it has."""
        if self.states is not None:
            return len(self.states.q)
        return sum(round(phase.duration / self.dt) for phase in self.phases)

    @property
    def only_phase(self) -> Phase:
        """The phase of a scenario that has no other.

        Raises
        ------
        ScenarioError
            When it has several, or none.
        """
        if len(self.phases) != 1:
            raise ScenarioError(f"scenario {self.name!r}: expected one phase, got {len(self.phases)}")
        return self.phases[0]

    @property
    def mode(self) -> Mode:
        """The only phase's mode."""
        return self.only_phase.mode

    @property
    def guide(self) -> Guide:
        """The only phase's guide."""
        return self.only_phase.guide


def _check_states(name: str, states: States, nv: int) -> None:
    count, m_free = len(states.q), len(states.mode.free_rows)
    for label, array, width in (("q", states.q, nv), ("qd_prev", states.qd_prev, nv), ("v", states.v, m_free)):
        if count == 0 or array.shape != (count, width):
            raise ScenarioError(
                f"scenario {name!r}: states.{label}: expected shape (N, {width}) with the same N of at least 1, "
                f"got {array.shape}"
            )
