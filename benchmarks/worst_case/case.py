"""What a search found, as a file that shows it again: every number to the last bit."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...codegen import compile_step
from ...robots import load_robot
from ..json_numbers import with_words
from ..store import write_whole
from .states import Batch, Draws
from .timing import Stopwatch

if TYPE_CHECKING:
    from pathlib import Path

    from ...codegen import CompiledStep

_KIND: Final = "kinqp worst case"
# Typical ticks that a replayed time is compared with.
_TYPICAL: Final = 50


class CaseError(ValueError):
    """A file isn't a worst case that can be shown again; the message names the file and what was expected."""


@dataclass(frozen=True)
class Found:
    """A state, and what its tick took.

    Attributes
    ----------
    q, v, qd_prev, qdd_prev : list of float
        [rad or m], [m/s, rad/s], [rad/s or m/s], [rad/s^2 or m/s^2]; the last two count where the formulation takes
        them. Infinite in `qdd_prev`: unknown.
    limits : dict of str to list of float
        Run-time inputs in place of the robot's own limits.
    iterations : int
    status : str
    active : list of str
        Rows that hold the command back, by name.
    seconds : float or None
        Of a tick, where and when it was found [s]; None where the search was ended before it came to timing.
    """

    q: list[float]
    v: list[float]
    qd_prev: list[float]
    qdd_prev: list[float]
    limits: dict[str, list[float]]
    iterations: int
    status: str
    active: list[str]
    seconds: float | None

    @classmethod
    def of(cls, step: CompiledStep, state: Batch, seconds: float | None) -> Found:
        """Describe a state, a batch of one."""
        memory = {name: rows[0] for name, rows in state.memory(step).items()}
        result = step(state.q[0], state.v[0], **state.limits, **memory)
        return cls(
            state.q[0].tolist(),
            state.v[0].tolist(),
            state.qd_prev[0].tolist(),
            state.qdd_prev[0].tolist(),
            {name: np.asarray(values).tolist() for name, values in state.limits.items()},
            result.iterations,
            result.status.value,
            list(result.active),
            seconds,
        )

    def state(self) -> Batch:
        """Give the state, as a batch of one."""
        limits = {name: np.array(values) for name, values in self.limits.items()}
        q, v, qd_prev, qdd_prev = (np.array([row]) for row in (self.q, self.v, self.qd_prev, self.qdd_prev))
        return Batch(q, v, qd_prev, qdd_prev, limits)

    @classmethod
    def read(cls, given: dict[str, Any]) -> Found:
        """Take what `written` gives; in files of earlier versions, which have no `qdd_prev`, it was unknown."""
        rows = {name: _numbers(given[name]) for name in ("q", "v", "qd_prev")}
        rows["qdd_prev"] = _numbers(given.get("qdd_prev", ["inf"] * len(rows["q"])))
        limits = {name: _numbers(values) for name, values in given["limits"].items()}
        return cls(**{**given, **rows, "limits": limits})

    def written(self) -> dict[str, Any]:
        """Describe it for JSON, which knows no infinity: as words they are read back as they were."""
        rows = {name: with_words(getattr(self, name)) for name in ("q", "v", "qd_prev", "qdd_prev")}
        return {**asdict(self), **rows, "limits": {name: with_words(values) for name, values in self.limits.items()}}


@dataclass(frozen=True)
class WorstCase:
    """What a search found.

    Attributes
    ----------
    robot, formulation, mode : str
        As given by name.
    tip : str or None
        Frame at the tool centre point, where the robot is a URDF that branches.
    most : Found
        The state with most iterations.
    slowest : Found
        The one whose tick takes longest; `most` once more where ticks were not timed.
    median : float or None
        Time of a typical tick, in the same run [s]; None where ticks were not timed.
    statuses : dict of str to int
        How the ticks of the search ended.
    ticks, seed : int
        Of the search.
    conditions : dict of str to str
        Machine and versions.
    """

    robot: str
    tip: str | None
    formulation: str
    mode: str
    most: Found
    slowest: Found
    median: float | None
    statuses: dict[str, int]
    ticks: int
    seed: int
    conditions: dict[str, str]


@dataclass(frozen=True)
class Replayed:
    """What a case takes here and now.

    Attributes
    ----------
    most, slowest : Found
    median : float
        Time of a typical tick [s].
    """

    most: Found
    slowest: Found
    median: float


def write_case(case: WorstCase, path: Path) -> None:
    """Write a case as JSON, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    both = {"most": case.most.written(), "slowest": case.slowest.written()}
    text = json.dumps({"kind": _KIND, **asdict(case), **both}, indent=1, allow_nan=False)
    write_whole(path, (text + "\n").encode())


def read_case(path: Path) -> WorstCase:
    """Read a case.

    Raises
    ------
    CaseError
        Naming the file, when it isn't one.
    """
    try:
        given: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if given.pop("kind") != _KIND:
            raise CaseError(f"{path}: expected a file that kinqp worst-case has written")
        return WorstCase(**{**given, "most": Found.read(given["most"]), "slowest": Found.read(given["slowest"])})
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CaseError(f"{path}: expected a file that kinqp worst-case has written: {error}") from error


def replay(case: WorstCase) -> Replayed:
    """Compile the case's step and run its two states again, and typical ones to compare their time with."""
    step = compile_step(load_robot(case.robot, tip=case.tip), case.formulation, case.mode)
    typical = Draws(step, np.random.default_rng(case.seed)).anywhere(_TYPICAL, {})
    states = [case.most.state(), case.slowest.state(), *(typical.pick(index) for index in range(len(typical)))]
    seconds = Stopwatch(step, case.seed).seconds(states)
    return Replayed(
        Found.of(step, states[0], seconds[0]), Found.of(step, states[1], seconds[1]), float(np.median(seconds[2:]))
    )


def _numbers(values: list[float | str]) -> list[float]:
    return [float(x) for x in values]
