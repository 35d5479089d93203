"""The generated C with clocks in it."""

from __future__ import annotations

import ctypes
import re
from functools import cached_property
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from kinqp.codegen.fields import identifier
from kinqp.codegen.model import step_code
from kinqp.codegen.render import render_batch, render_step
from kinqp.codegen.step import STEP_FLAGS
from kinqp.formulations import Mode, get_formulation
from kinqp.solvers.native import build_library

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kinqp.robots import Robot

    from .states import States

    Array = NDArray[np.float64]
    Integers = NDArray[np.intc]

#: What ends at marks 1 to 7.
STAGES: Final = (
    "checks",
    "sines and cosines",
    "kinematics, inverse, bounds",
    "reduction",
    "without rows",
    "with rows",
    "command",
)
WHOLE, QP, PROFILE = 0, 1, 2
_POINTER: Final = ctypes.c_void_p


class InstrumentError(RuntimeError):
    """The generated source doesn't look as it did when its marks were chosen; the message names the place."""


class TimedTick:
    """The tick of a formulation on a robot in a mode, compiled as `compile_step` does, with its own clock.

    Parameters
    ----------
    robot : Robot
    formulation, mode : str
        Registered name, and as in `Mode.parse`.
    states : States
        What is timed.
    level : {WHOLE, QP, PROFILE}
        Where the clocks are; see ``timing.c``.
    flags : sequence of str
        Further compiler flags.
    """

    def __init__(
        self, robot: Robot, formulation: str, mode: str, states: States, level: int, flags: Sequence[str] = ()
    ) -> None:
        self.states: Final = states
        prefix = identifier(f"kinqp_{robot.name}_{formulation}")
        code = step_code(robot, get_formulation(formulation), [Mode.parse(mode)], prefix)
        sources = render_step(code)
        source = sources.pop(f"{prefix}.c")
        sources["step.inc"] = instrumented(source, [array.partition("[")[0] for array in code.single[0].arrays])
        sources["batch.inc"] = render_batch(code)
        sources["timing.c"] = (files(__package__) / "timing.c").read_text(encoding="utf-8")
        library = build_library(
            f"{prefix}_timed", sources, flags=(*STEP_FLAGS, *flags, f"-DPREFIX={prefix}", f"-DLEVEL={level}")
        )
        self._library: Final = ctypes.CDLL(str(library))
        self._library.kinqp_clock_unit.restype = ctypes.c_double
        self._library.kinqp_clock_unit.argtypes = [ctypes.c_double]
        for name in ("kinqp_clock_cost", "kinqp_gettime_cost", "kinqp_loop"):
            getattr(self._library, name).restype = ctypes.c_double
        self._library.kinqp_pass.restype = None
        self._library.kinqp_pass.argtypes = [ctypes.c_long, ctypes.c_long, *6 * [_POINTER]]
        self._library.kinqp_loop.argtypes = [ctypes.c_long, *5 * [_POINTER]]
        count = len(states.q)
        self.qd: Final[Array] = np.zeros((count, robot.nv))
        self.status: Final[Integers] = np.full(count, -1, dtype=np.intc)
        self.iterations: Final[Integers] = np.zeros(count, dtype=np.intc)
        self._best: Final[Array] = np.full((count, len(STAGES)), np.inf)
        arrays = (states.q, states.v, self._best, self.qd, self.status, self.iterations)
        self._arguments: Final = [_POINTER(array.ctypes.data) for array in arrays]
        self.run: Final[Any] = self._library.kinqp_pass

    @cached_property
    def unit(self) -> float:
        """Nanoseconds per unit of the clock."""
        return float(self._library.kinqp_clock_unit(0.2))

    @cached_property
    def cost(self) -> float:
        """What measuring nothing takes [clock units]."""
        return float(self._library.kinqp_clock_cost())

    def gettime_cost(self) -> float:
        """What clock_gettime adds to a time that it is read for [ns], at best."""
        return float(self._library.kinqp_gettime_cost())

    def reset(self) -> None:
        """Forget the times so far."""
        self._best.fill(np.inf)

    def one(self, index: int) -> None:
        """Run a single state."""
        self.run(index, index + 1, *self._arguments)

    def passes(self) -> None:
        """Run all states once."""
        self.run(0, len(self.states.q), *self._arguments)

    def stages(self) -> Array:
        """Smallest time of each stage of each state since the last reset [ns], shape (N, 7); infinite: not taken."""
        return np.maximum(self._best - self.cost, 0.0) * self.unit

    def whole(self) -> Array:
        """Smallest time of the tick of each state [ns], shape (N,); with `level` WHOLE."""
        return self.stages()[:, -1]

    def qp(self) -> Array:
        """Smallest time of the QP of each state [ns], shape (N,); with `level` QP."""
        return self.stages()[:, STAGES.index("with rows")]

    def loop(self, q: Array, v: Array) -> float:
        """Run ticks in a C loop without clocks; nanoseconds in all."""
        # Written to once, so that the loop doesn't pay for memory that the system hands out at first touch.
        arrays = (q, v, np.ones_like(q), np.ones_like(v), np.ones(len(q), dtype=np.intc))
        return float(self._library.kinqp_loop(len(q), *(_POINTER(array.ctypes.data) for array in arrays)))


def instrumented(source: str, targets: Sequence[str]) -> str:
    """Put marks between the stages of a generated source with one mode.

    Parameters
    ----------
    source : str
        The generated C.
    targets : sequence of str
        The arrays that the data are written to.

    Raises
    ------
    InstrumentError
        When a place is not found exactly once.
    """
    hold = "".join(f" KINQP_HOLD({target});" for target in targets)
    # Mark 1 before the sines, 2 behind them, 3 behind the data, 4 behind the reduction, 5 behind the solver, 6 behind
    # what brings its answer back to x.
    sines = r"    KINQP_MARK(2, 1);\n\g<0>    KINQP_HOLD(sine); KINQP_HOLD(cosine); KINQP_MARK(2, 2);\n"
    places = (
        (r"^    kinqp_sincos\(\d+, in->q.*\n", sines),
        (r"^    int outside = 0;\n", rf"   {hold} KINQP_MARK(1, 3);\n\g<0>"),
        (r"^    /\* (?:Without rows the answer|The minimiser without rows).*\n", r"    KINQP_MARK(2, 4);\n\g<0>"),
        (r"^    if \(outside\) \{\n", r"    KINQP_MARK(2, 5);\n\g<0>"),
        (r"^    double qd\[\d+\] = \{0\};\n", r"    KINQP_HOLD(x); KINQP_MARK(1, 6);\n\g<0>"),
    )  # fmt: skip
    text = source
    for pattern, replacement in places:
        text, found = re.subn(pattern, replacement, text, flags=re.MULTILINE)
        if found != 1:
            raise InstrumentError(f"marks of the speed suite: expected one place like {pattern!r}, found {found}")
    return text


def compiler_flags() -> str:
    """The flags that the tick is compiled with."""
    return " ".join(flag for flag in STEP_FLAGS if flag != "-lm")
