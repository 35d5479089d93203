"""Scenarios of a few ticks, and solvers that misbehave, for tests of the machinery around them."""

from __future__ import annotations

import ctypes
import itertools
import json
import os
import resource
import signal
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from kinqp.benchmarks import Phase, Scenario, States, get_scenario
from kinqp.formulations import Mode
from kinqp.solvers import Solver, get_solver
from kinqp.solvers.solution import RawSolution

if TYPE_CHECKING:
    from kinqp.solvers import QP


HERE_TINY = "tests.benchmarks.tiny:tiny"


def tiny() -> Scenario:
    """Twenty ticks of the semicircle."""
    scenario = get_scenario("semicircle")
    return replace(scenario, name="tiny", phases=(replace(scenario.only_phase, duration=0.02),))


def two_phases() -> Scenario:
    """Eight ticks with the orientation locked, then six on a line: other sizes."""
    scenario = get_scenario("semicircle")
    guide = scenario.guide
    phases = (Phase(Mode.fix_orientation(), guide, 0.008), Phase(Mode.line("z"), guide, 0.006))
    return replace(scenario, name="two_phases", phases=phases)


def three_states() -> Scenario:
    """Three states, from rest, within velocity limits narrower than the arm's."""
    scenario = get_scenario("semicircle")
    q = scenario.q0 + np.array([[0.0], [0.1], [0.2]])
    v = np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.1, 0.2]])
    states = States(Mode.fix_orientation(), q, np.zeros((3, 7)), v)
    inputs = {"qd_max": np.full(7, 0.1)}
    return replace(scenario, name="three_states", phases=(), states=states, inputs=inputs)


def unknown_input() -> Scenario:
    """With an input that no formulation takes."""
    return replace(tiny(), name="unknown_input", inputs={"wind": 1.0})


class Delegating(Solver):
    """Solves as the active set does, after something of its own."""

    name: ClassVar[str] = "delegating"

    def __init__(self) -> None:
        super().__init__(tolerance=1e-9)
        self._solver = get_solver("active-set")
        self._calls = itertools.count(1)

    def before(self, call: int) -> None:
        """Do something before the solve of this number."""

    def after(self, x: np.ndarray, call: int) -> np.ndarray:  # noqa: ARG002  # for subclasses
        """Change the answer."""
        return x

    def _setup(self, qp: QP) -> None:
        pass

    def _update(self, qp: QP) -> None:
        pass

    def _solve(self, qp: QP) -> RawSolution:
        call = next(self._calls)
        self.before(call)
        s = self._solver.solve(qp)
        return RawSolution(claimed=s.status, x=self.after(s.x, call), y=s.y, z=s.z, z_box=s.z_box, iterations=7)


class Crashing(Delegating):
    """Ends its process in the middle of the run."""

    def before(self, call: int) -> None:
        if call == 10:
            os.kill(os.getpid(), signal.SIGSEGV)


class CrashingLate(Delegating):
    """Lasts for the run, and not for its repetitions."""

    def before(self, call: int) -> None:
        if call == 30:
            os.kill(os.getpid(), signal.SIGSEGV)


class Killed(Delegating):
    """Is what the kernel ends when memory runs out."""

    def before(self, call: int) -> None:
        if call == 10:
            os.kill(os.getpid(), signal.SIGKILL)


# Names the file to which `Telling` writes.
TOLD = "KINQP_TESTS_TOLD"


class Telling(Delegating):
    """Writes down the environment of the process that it solves in, and how many threads that has for BLAS."""

    def before(self, call: int) -> None:
        if call == 1:
            large = np.ones((600, 600))
            large @ large
            # The library's threads have the process's own name; those of others (Polars, jemalloc) name theirs.
            names = [(task / "comm").read_text() for task in Path("/proc/self/task").iterdir()]
            told = {"environment": dict(os.environ), "threads": names.count(Path("/proc/self/comm").read_text())}
            Path(os.environ[TOLD]).write_text(json.dumps(told))


# More than is left over from what a run takes, and little enough for any machine [bytes].
ROOM = 256 * 2**20


class Hungry(Delegating):
    """Takes all the memory that it is given, until there is none; `at` is the call that does."""

    at: ClassVar[int] = 10

    def before(self, call: int) -> None:
        if call == self.at:
            _leave(ROOM)
            eaten = []
            while True:
                eaten.append(np.ones(2**20))


class HungryLate(Hungry):
    """The same once it is timed."""

    at: ClassVar[int] = 30


class HungryInC(Delegating):
    """The same in a library that does not expect to be given nothing, and writes there all the same."""

    def before(self, call: int) -> None:
        if call == 10:
            _leave(ROOM)
            c = ctypes.CDLL(None)
            c.malloc.restype, c.memset.argtypes = ctypes.c_void_p, (ctypes.c_void_p, ctypes.c_int, ctypes.c_size_t)
            while True:
                c.memset(c.malloc(ctypes.c_size_t(2**24)), 1, 2**24)


def _leave(room: int) -> None:
    """Limit this process's memory to what it has and some more [bytes]."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + room, resource.RLIM_INFINITY))


class Hanging(Delegating):
    """Never comes back."""

    def before(self, call: int) -> None:
        if call == 10:
            time.sleep(3600.0)


class Mistaken(Delegating):
    """Has a mistake in its code."""

    def before(self, call: int) -> None:
        if call == 10:
            raise KeyError("no such row")


class Drifting(Delegating):
    """Answers differently every time, by less than is noticed."""

    def after(self, x: np.ndarray, call: int) -> np.ndarray:
        return x * (1.0 + 1e-13 * call)


class Lying(Delegating):
    """Claims to have solved what it has not."""

    def after(self, x: np.ndarray, call: int) -> np.ndarray:
        return x + 1e-3 if call % 2 == 0 else x


class Slow(Delegating):
    """Takes its time."""

    def before(self, call: int) -> None:  # noqa: ARG002  # as of the others
        time.sleep(0.01)
