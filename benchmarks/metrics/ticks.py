"""A cell's ticks as arrays, with what can be recomputed from states and commands alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from .motion import beyond, overshoot
from .possible import Possible

if TYPE_CHECKING:
    import polars as pl
    from numpy.typing import NDArray

    from ...formulations import Mode
    from ..scenarios import Scenario

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]

# Slower than this the hand counts as not pulling [m/s, rad/s].
PULLING: Final = 1e-3
_ROTATIONS: Final = frozenset({3, 4, 5})


class FrameError(ValueError):
    """A frame is not a cell's; the message names the column, what was expected and what was got."""


@dataclass(frozen=True)
class LockedRows:
    """The locked rows of the commands that were sent, and how far the tool is off what they should have kept.

    Attributes
    ----------
    linear, angular : ndarray, shape (N,)
        Largest |J_fixed qd - v_fixed| of the translations [m/s] and of the rotations [rad/s].
    relative : ndarray, shape (N,)
        Largest of all of them, each over the joint speeds' share in its row, |J_fixed| |qd| + |v_fixed|, where that
        exceeds 1.
    offset, turn : ndarray, shape (N,)
        How far the tool is from where it was when the phase began, along what is locked [m; rad]; of `rcm` how far its
        axis is from the pivot. Zero for states.
    """

    linear: Array
    angular: Array
    relative: Array
    offset: Array
    turn: Array


@dataclass(frozen=True)
class Ticks:
    """A cell's ticks.

    Attributes
    ----------
    scenario : Scenario
    frame : pl.DataFrame
        As it was stored.
    """

    scenario: Scenario
    frame: pl.DataFrame

    def __post_init__(self) -> None:
        count = len(self.frame)
        if not 0 < count <= self.scenario.ticks:
            raise FrameError(
                f"ticks: expected 1 to {self.scenario.ticks} rows for scenario {self.scenario.name!r}, got {count}"
            )

    @cached_property
    def loop(self) -> str:
        """Say what one tick has to do with the next.

        "closed": it leads to it. "states": nothing, all of the scenario's states are there. "sampled": nothing, they
        are some of those of a closed loop.
        """
        if self.scenario.states is not None:
            return "states"
        t = self.column("t")
        complete = len(t) == self.scenario.ticks and np.allclose(t, np.arange(len(t)) * self.scenario.dt)
        return "closed" if complete else "sampled"

    @property
    def closed_loop(self) -> bool:
        """Whether one tick leads to the next."""
        return self.loop == "closed"

    def column(self, name: str) -> Array:
        """Return a column as floats, NaN for null: shape (N,), or (N, k) where its entries are vectors of length k.

        Raises
        ------
        FrameError
            When there is no such column, or its entries differ in length.
        """
        if name not in self.frame.columns:
            raise FrameError(f"ticks: expected a column {name!r}, got {', '.join(self.frame.columns)}")
        try:
            return np.array(self.frame[name].to_list(), dtype=float)
        except ValueError as error:
            raise FrameError(f"ticks: {name}: expected numbers, of the same shape in every row: {error}") from error

    def words(self, name: str) -> NDArray[np.object_]:
        """Return a column of words, shape (N,)."""
        if name not in self.frame.columns:
            raise FrameError(f"ticks: expected a column {name!r}, got {', '.join(self.frame.columns)}")
        return np.array(self.frame[name].to_list(), dtype=object)

    @cached_property
    def q(self) -> Array:
        """States, shape (N, nv) [rad or m]."""
        return self.column("q")

    @cached_property
    def qd(self) -> Array:
        """Commands, shape (N, nv) [rad/s or m/s]."""
        return self.column("qd")

    @cached_property
    def q_next(self) -> Array:
        """States after the commands, shape (N, nv) [rad or m]."""
        after: Array = self.q + self.scenario.dt * self.qd
        return after

    @cached_property
    def qd_before(self) -> Array:
        """Commands of the ticks before, from rest, shape (N, nv) [rad/s or m/s]; of a closed loop."""
        if not self.closed_loop:
            raise ValueError(f"ticks: expected a closed loop, in which one command follows another, got {self.loop}")
        return np.vstack([np.zeros((1, self.qd.shape[1])), self.qd[:-1]])

    @cached_property
    def acceleration(self) -> Array:
        """Change of the command over one period, as shares of `qdd_max`, shape (N, nv); of a closed loop."""
        change: Array = (self.qd - self.qd_before) / self.scenario.dt / self.limit("qdd_max")
        return change

    def limit(self, name: str) -> Array:
        """Return `q_min`, `q_max`, `qd_max` or `qdd_max` as the scenario has it, shape (nv,)."""
        return self.scenario.limit(name)

    @cached_property
    def phase(self) -> NDArray[np.int64]:
        """Number of each tick's phase, shape (N,); zero for states."""
        return self.column("phase").astype(np.int64)

    @cached_property
    def switched(self) -> Flags:
        """Ticks at which another mode takes over, shape (N,)."""
        return np.diff(self.phase, prepend=self.phase[:1]) > 0

    def mode(self, phase: int) -> Mode:
        """Mode of a phase."""
        return self.scenario.states.mode if self.scenario.states is not None else self.scenario.phases[phase].mode

    @cached_property
    def v(self) -> Array:
        """Velocity asked for in all six rows of the mode, zero where they aren't guided, shape (N, 6) [m/s, rad/s]."""
        return self._rows("v")

    @cached_property
    def eps(self) -> Array:
        """Cartesian error in all six rows of the mode, zero where they aren't guided, shape (N, 6) [m/s, rad/s]."""
        return self._rows("eps")

    def _rows(self, name: str) -> Array:
        if name not in self.frame.columns:
            raise FrameError(f"ticks: expected a column {name!r}, got {', '.join(self.frame.columns)}")
        given, rows = self.frame[name].to_list(), np.zeros((len(self.frame), 6))
        for phase in np.unique(self.phase):
            (here,), free = np.nonzero(self.phase == phase), list(self.mode(phase).free_rows)
            try:
                values = np.array([given[k] for k in here], dtype=float)
            except ValueError as error:
                raise FrameError(f"ticks: {name}: expected vectors of one length in a phase: {error}") from error
            if values.shape != (len(here), len(free)):
                raise FrameError(
                    f"ticks: {name}: expected {len(free)} entries in phase {phase}, got {values.shape[1:]}"
                )
            rows[np.ix_(here, np.array(free))] = values
        return rows

    @cached_property
    def pulling(self) -> Flags:
        """Ticks at which the hand asks for more than `PULLING`, shape (N,)."""
        flags: Flags = (
            np.maximum(np.linalg.norm(self.v[:, :3], axis=1), np.linalg.norm(self.v[:, 3:], axis=1)) > PULLING
        )
        return flags

    @cached_property
    def distance(self) -> Array:
        """From each joint to its nearer limit, negative beyond it, shape (N, nv) [rad or m]; before the command."""
        nearer: Array = np.minimum(self.limit("q_max") - self.q, self.q - self.limit("q_min"))
        return nearer

    @property
    def overshoot(self) -> float:
        """How far a joint went beyond its limits [rad or m]; see `kinqp.benchmarks.metrics.motion.overshoot`."""
        low, high = self.limit("q_min"), self.limit("q_max")
        if self.closed_loop:
            return overshoot(np.vstack([self.q, self.q_next[-1:]]), low, high)
        return float(np.max(beyond(self.q_next, low, high) - beyond(self.q, low, high), initial=0.0))

    @cached_property
    def possible(self) -> Possible:
        """What the arm could have done at some of the ticks."""
        return Possible.of(self)

    @cached_property
    def locked(self) -> LockedRows:
        """What became of the locked rows; kinematics by pinocchio, apart from what computed the commands."""
        robot, out = self.scenario.robot, np.zeros((5, len(self.frame)))
        for phase in np.unique(self.phase):
            (here,), mode = np.nonzero(self.phase == phase), self.mode(phase)
            if not mode.m_fixed:
                continue
            fixed = np.array(mode.fixed_rows)
            poses = np.array([robot.pose(q) for q in self.q[here]])
            maps = [mode.twist_map_at(pose)[fixed] for pose in poses]
            rows = np.array([each @ robot.jacobian(q) for each, q in zip(maps, self.q[here], strict=True)])
            wanted = np.broadcast_to(np.asarray(self.scenario.inputs.get("v_fixed", 0.0), float), (mode.m_fixed,))
            error = np.abs(np.einsum("tij,tj->ti", rows, self.qd[here]) - wanted)
            share = np.einsum("tij,tj->ti", np.abs(rows), np.abs(self.qd[here])) + np.abs(wanted)
            out[0, here] = np.max(error[:, fixed < 3], axis=1, initial=0.0)
            out[1, here] = np.max(error[:, fixed >= 3], axis=1, initial=0.0)
            out[2, here] = np.max(error / np.maximum(share, 1.0), axis=1)
            if self.closed_loop:
                out[3:, here] = _off(mode, poses)
        return LockedRows(*out)


def _off(mode: Mode, poses: Array) -> tuple[Array, Array]:
    """How far the tool has left what the mode locks, from the first pose on [m], and its orientation [rad]."""
    rotations, positions = poses[:, :3, :3], poses[:, :3, 3]
    turn = np.zeros(len(poses))
    if set(mode.fixed_rows) >= _ROTATIONS:
        # By the chord: the angle from the trace alone has no digits left near zero.
        chord = np.linalg.norm(rotations - rotations[0], axis=(1, 2)) / np.sqrt(8.0)
        turn = 2.0 * np.arcsin(np.minimum(chord, 1.0))
    if mode.depth:
        pivot = positions[0] + mode.depth * rotations[0, :, 2]
        return np.linalg.norm(np.cross(rotations[:, :, 2], pivot - positions), axis=1), turn
    axes = np.array(mode.axes) @ (rotations[0].T if mode.frame == "tool" else np.eye(3))
    way = (positions - positions[0]) @ axes[[row for row in mode.fixed_rows if row < 3]].T
    return np.linalg.norm(way, axis=1), turn
