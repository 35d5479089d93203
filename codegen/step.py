"""A formulation compiled: the C that is exported, loaded into Python."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..formulations import InputError, check_input
from ..solvers import Status
from ..solvers.active_set import STATUSES
from ..solvers.native import NATIVE, build_library, declarations
from . import qrqp
from .fields import MEMORY, identifier
from .model import step_code
from .render import render_batch, render_step
from .results import BatchResult, TickResult

if TYPE_CHECKING:
    from collections.abc import Container

    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Formulation, Input, Mode
    from ..robots import Robot
    from .model import StepCode

    Array = NDArray[np.float64]
    Integers = NDArray[np.intc]

SOLVER: Final = "active-set"
# All that the processor has, but the bits of any other machine: nothing is fused, and the compiler makes no vectors of
# its own, in which gcc would fuse all the same. The sources bring theirs.
STEP_FLAGS: Final = (
    *("-std=c99", "-O3", NATIVE, "-fno-tree-vectorize", "-ffp-contract=off", "-fno-math-errno"),
    *("-fPIC", "-shared", "-lm"),
)
_NONE: Final = np.zeros(0)
_DOUBLE: Final = np.dtype(np.float64)
_new: Final = tuple.__new__
_FAILED: Final = STATUSES.index(Status.FAILED)


class CompiledStep:
    """A formulation on a robot in a mode as compiled C; `compile_step` makes one.

    The command of a state depends on that state alone, bit for bit. Not to be shared between threads.

    Parameters
    ----------
    robot : Robot
    formulation : Formulation
    mode : Mode
    solver : {"active-set", "casadi-qrqp"}
        The solver in the C code; see `compile_step`.
    feasible : bool
        Keep to admissible points: a tick that reaches `max_iterations` still gives a usable command.
    max_iterations : int, optional
        Cap on active-set steps of a tick; generous unless told otherwise.

    Raises
    ------
    CompilerError
        When there is no C compiler, or it fails.
    """

    def __init__(
        self,
        robot: Robot,
        formulation: Formulation,
        mode: Mode,
        solver: str = SOLVER,
        *,
        feasible: bool = False,
        max_iterations: int | None = None,
    ) -> None:
        import cffi

        self.robot: Final = robot
        self.formulation: Final = formulation
        self.mode: Final = mode
        prefix = identifier(f"kinqp_{robot.name}_{formulation.name}")
        code = step_code(robot, formulation, [mode], prefix)
        self.code: Final[StepCode] = code
        files = render_step(code) if solver == SOLVER else qrqp.render_qrqp(code, formulation, robot, mode)
        batch = render_batch(code)
        ffi = cffi.FFI()
        prototype = "void " + batch.partition("void ")[2].partition(";")[0] + ";"
        ffi.cdef(declarations(files[f"{prefix}.h"]) + "\n" + prototype)
        library = build_library(prefix, files | {f"{prefix}_batch.c": batch}, flags=STEP_FLAGS)
        self._ffi: Final = ffi
        self._library: Final = ffi.dlopen(str(library))
        self._run: Final = getattr(self._library, f"{prefix}_step")
        self._run_batch: Final = getattr(self._library, f"{prefix}_batch")
        self._parameters: Final = ffi.new(f"{prefix}_parameters *")
        getattr(self._library, f"{prefix}_default_parameters")(self._parameters)
        self._parameters.feasible = int(feasible)
        if max_iterations is not None:
            if max_iterations < 0:
                raise ValueError(f"max_iterations: expected a count that is not negative, got {max_iterations}")
            self._parameters.max_iterations = max_iterations
        self._input: Final = ffi.new(f"{prefix}_input *")
        self._output: Final = ffi.new(f"{prefix}_output *")
        self._specs: Final[dict[str, Input]] = {given.name: given for given in code.modes[0].inputs}
        self._required: Final = {name for name, given in self._specs.items() if given.default is None} - {"q", "v"}
        # Inputs without entries have no field.
        self._signals: Final = {name: np.zeros(0) for name, given in self._specs.items() if not given.size}
        self._signals.update({field.name: self._view(self._input, field.name) for field in code.inputs})
        self._fields: Final = {field.name: self._parameter_view(field.name) for field in code.parameters}
        self._memory: Final = tuple(name for name in self._fields if name in MEMORY)
        self._q: Final = self._signals["q"]
        self._v: Final = self._signals["v"]
        self._shape_q: Final = self._q.shape
        self._shape_v: Final = self._v.shape
        self._rows: Final = code.modes[0].rows
        self._quiet: Final = bool(code.single)
        self._qd: Final = self._view(self._output, "qd")
        self._eps: Final = self._view(self._output, "eps")
        self._sides: Final = self._view(self._output, "active", np.dtype(np.intc))
        self._no_sides: Final = np.zeros_like(self._sides)
        self._no_sides.flags.writeable = False

    @property
    def feasible(self) -> bool:
        """Whether a tick that reaches `max_iterations` still gives a usable command."""
        return bool(self._parameters.feasible)

    @property
    def specs(self) -> tuple[Input, ...]:
        """What a call takes: `q`, `v` and the run-time inputs, with their sizes, defaults and ranges."""
        return tuple(self._specs.values())

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the run-time inputs, beyond `q` and `v`, that a call takes by keyword."""
        return tuple(name for name in self._specs if name not in ("q", "v"))

    def __call__(self, q: ArrayLike, v: ArrayLike, **inputs: ArrayLike) -> TickResult:
        """Compute the command.

        Parameters
        ----------
        q : array_like, shape (nv,)
            Joint positions [rad or m].
        v : array_like, shape (m_free,)
            Velocity that the hand asks for, along the mode's axes [m/s, rad/s].
        **inputs : array_like
            Any of `inputs`, for this call only.

        Raises
        ------
        InputError
            Naming the input that is unknown, missing, of the wrong shape, not finite or out of range.
        """
        # Arrays of the right kind are not looked at further here: the C code refuses what isn't finite.
        fits = type(q) is np.ndarray and q.dtype is _DOUBLE and q.shape == self._shape_q
        self._q[:] = q if fits else check_input(self._specs["q"], q, self.mode)
        fits = type(v) is np.ndarray and v.dtype is _DOUBLE and v.shape == self._shape_v
        self._v[:] = v if fits else check_input(self._specs["v"], v, self.mode)
        output = self._output
        simple = not (inputs or self._required)
        code = self._run(self._parameters, self._input, output) if simple else self._run_with(inputs)
        if code == _FAILED:
            for name, values in (("q", self._q), ("v", self._v)):
                check_input(self._specs[name], values, self.mode)
        iterations = output.iterations
        # Without a step no row is active, unless a solver takes rows for equalities; and past NamedTuple's own
        # constructor, which takes twice the time.
        sides = self._sides.copy() if iterations or not self._quiet else self._no_sides
        return _new(TickResult, (self._qd.copy(), self._eps.copy(), STATUSES[code], iterations, sides, self._rows))

    def _run_with(self, inputs: dict[str, ArrayLike]) -> int:
        restore = self._override(inputs)
        try:
            return int(self._run(self._parameters, self._input, self._output))
        finally:
            for values, before in restore:
                values[:] = before

    def batch(self, Q: ArrayLike, V: ArrayLike, **inputs: ArrayLike) -> BatchResult:
        """Compute the commands of many states in one call into C.

        Parameters
        ----------
        Q : array_like, shape (N, nv)
            Joint positions [rad or m].
        V : array_like, shape (N, m_free)
            Velocities that the hand asks for [m/s, rad/s].
        **inputs : array_like
            Parameters (limits, weights, `dt`), the same for all states; and, of shape (N, size), what is new at every
            tick (`qd_prev`, `v_fixed`). `qdd_prev` is taken either way, of shape (size,) or (N, size).

        Raises
        ------
        InputError
            Naming the input that is not usable. A state that isn't finite refuses its own tick only, whose status is
            FAILED. NaN in `qdd_prev`, which may be infinite, refuses the batch.
        """
        states = np.ascontiguousarray(Q, dtype=float)
        twists = np.ascontiguousarray(V, dtype=float)
        shapes = (len(states), self.robot.nv), (len(states), self.mode.m_free)
        for name, values, shape in (("Q", states, shapes[0]), ("V", twists, shapes[1])):
            if values.shape != shape:
                raise InputError(f"{name}: expected shape {shape}, got {values.shape}")
        signals = {name: self._signal(name, inputs, len(states)) for name in self._signals if name not in ("q", "v")}
        memory = {name: self._rows_of(name, inputs, len(states)) for name in self._memory}
        inputs = {name: x for name, x in inputs.items() if name not in signals and not memory.get(name, _NONE).size}
        count, rows = len(states), self.code.rows
        result = BatchResult(
            np.empty_like(states),
            np.empty_like(twists),
            np.empty(count, dtype=np.intc),
            np.empty(count, dtype=np.intc),
            np.empty((count, rows), dtype=np.intc),
            self.code.modes[0].rows,
        )
        restore = self._override(inputs, given=signals)
        try:
            per_tick = [signals[field.name] for field in self.code.inputs if field.name not in ("q", "v")]
            per_tick += memory.values()
            doubles = [self._pointer("double *", x) for x in (states, twists, *per_tick, result.qd, result.eps)]
            integers = [self._pointer("int *", x) for x in (result.codes, result.iterations, result.sides)]
            self._run_batch(self._parameters, 0, count, *doubles, *integers)
        finally:
            for values, before in restore:
                values[:] = before
        return result

    def _signal(self, name: str, inputs: dict[str, ArrayLike], count: int) -> Array:
        """One row for each tick of a batch; none at all where it is left out, which stands for zeros."""
        size = self._specs[name].size
        if name not in inputs:
            if name in self._required:
                raise InputError(f"{name}: expected shape ({count}, {size}), got nothing")
            return np.zeros(0)
        try:
            values = np.ascontiguousarray(inputs[name], dtype=float)
        except (TypeError, ValueError):
            raise InputError(f"{name}: expected shape ({count}, {size}), got {inputs[name]!r}") from None
        if values.shape != (count, size):
            raise InputError(f"{name}: expected shape ({count}, {size}), one row for each tick, got {values.shape}")
        return values

    def _rows_of(self, name: str, inputs: dict[str, ArrayLike], count: int) -> Array:
        """One row of a parameter for each tick; none at all where it is left out, or the same for all of them."""
        if name not in inputs or np.ndim(inputs[name]) < 2:
            return _NONE
        values = self._signal(name, inputs, count)
        if np.isnan(values).any():
            raise InputError(f"{name}: expected numbers, got NaN in row {int(np.isnan(values).any(axis=1).argmax())}")
        return values

    def _override(self, inputs: dict[str, ArrayLike], given: Container[str] = ()) -> list[tuple[Array, Array]]:
        checked: list[tuple[Array, Array]] = []
        for name, value in inputs.items():
            if name not in self._specs or name in ("q", "v"):
                raise InputError(f"{name}: expected an input among {', '.join(self.inputs)}, got {name!r}")
            values = self._signals[name] if name in self._signals else self._fields[name]
            checked.append((values, np.broadcast_to(check_input(self._specs[name], value, self.mode), values.shape)))
        for name in self._required:
            if name not in inputs and name not in given:
                raise InputError(f"{name}: expected shape ({self._specs[name].size},), got nothing")
        self._check_limits(inputs)
        restore = [(values, values.copy()) for values, _ in checked]
        for values, new in checked:
            values[:] = new
        return restore

    def _check_limits(self, inputs: dict[str, ArrayLike]) -> None:
        if not ("q_min" in inputs or "q_max" in inputs) or not {"q_min", "q_max"} <= self._fields.keys():
            return
        low, high = (np.asarray(inputs.get(name, self._fields[name]), dtype=float) for name in ("q_min", "q_max"))
        if (low > high).any():
            raise InputError(f"q_min and q_max: expected q_min <= q_max at every joint, got {low} and {high}")

    def _pointer(self, kind: str, values: NDArray[Any]) -> Any:
        return self._ffi.cast(kind, self._ffi.from_buffer(values)) if values.size else self._ffi.NULL

    def _view(self, struct: Any, name: str, kind: np.dtype[Any] | None = None) -> Any:
        return np.frombuffer(self._ffi.buffer(getattr(struct, name)), dtype=kind or np.float64)

    def _parameter_view(self, name: str) -> Any:
        address = self._ffi.addressof(self._parameters[0], name)
        size = self._ffi.sizeof(self._ffi.typeof(address).item)
        return np.frombuffer(self._ffi.buffer(address, size), dtype=np.float64)
