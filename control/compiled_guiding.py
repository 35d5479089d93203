"""A whole hand-guiding controller compiled: the C that is exported, loaded into Python."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..codegen.fields import prefix_of
from ..codegen.model import step_code
from ..codegen.render import render_step
from ..codegen.step import STEP_FLAGS
from ..formulations import DEFAULT_DT, get_formulation
from ..solvers import Status
from ..solvers.active_set import STATUSES
from ..solvers.native import build_library, declarations
from .checks import checked_array, checked_modes, checked_period
from .guiding_code import render_guiding
from .guiding_law import GuidingLaw
from .guiding_result import GuidingPhase, GuidingResult
from .guiding_settings import GuidingSettings
from .mode_values import ModeValues
from .set_inputs import index_of_mode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Formulation, Input, Mode
    from ..robots import Robot

    Array = NDArray[np.float64]

_PHASES: Final = (GuidingPhase.GUIDING, GuidingPhase.STOPPING, GuidingPhase.STOPPED)


class CompiledGuiding:
    """What `GuidingController` is, in C; `make_guiding` makes one.

    The same declaration and the same order of things, so that commands agree to rounding. Not to be shared between
    threads.

    Parameters
    ----------
    robot : Robot
    formulation : str or Formulation
    modes : sequence of str or Mode
        The first one is engaged at the beginning.
    settings : GuidingSettings, optional
    dt : float
        Control period [s].

    Raises
    ------
    CompilerError
        When there is no C compiler, or it fails.
    ValueError
        When there are no modes, or one twice, or `dt` is no period.
    """

    def __init__(
        self,
        robot: Robot,
        formulation: str | Formulation,
        modes: Sequence[str | Mode],
        settings: GuidingSettings | None = None,
        dt: float = DEFAULT_DT,
    ) -> None:
        import cffi

        made = get_formulation(formulation)
        self.robot: Final = robot
        self.modes: Final = checked_modes(modes)
        self.settings: Final = settings or GuidingSettings()
        self.dt: Final = checked_period(dt)
        prefix = prefix_of(robot.name, made.name)
        code = step_code(robot, made, self.modes, prefix)
        files = render_step(code) | render_guiding(code, robot, self.modes, self.settings, self.dt)
        ffi = cffi.FFI()
        ffi.cdef(declarations(files[f"{prefix}.h"] + files[f"{prefix}_guiding.h"]))
        self._ffi: Final = ffi
        self._library: Final = ffi.dlopen(str(build_library(f"{prefix}_guiding", files, flags=STEP_FLAGS)))
        self._tick: Final = getattr(self._library, f"{prefix}_guiding_tick")
        self._start: Final = getattr(self._library, f"{prefix}_start_guiding")
        self._parameters: Final = ffi.new(f"{prefix}_guiding_parameters *")
        self._state: Final = ffi.new(f"{prefix}_guiding_state *")
        self._input: Final = ffi.new(f"{prefix}_guiding_input *")
        self._output: Final = ffi.new(f"{prefix}_guiding_output *")
        getattr(self._library, f"{prefix}_default_guiding")(self._parameters)
        self._rows: Final = tuple(mode.rows for mode in code.modes)
        self._values: Final = self._settable(code)
        self._q: Final = self._view(self._input, "q")
        self._wrench: Final = self._view(self._input, "wrench")
        self._results: Final = {name: self._view(self._output, name) for name in ("qd", "v", "v_actual", "drift")}
        self._sides: Final = np.frombuffer(ffi.buffer(self._output.active), dtype=np.intc)
        self._reason = ""
        self.reset()

    def _settable(self, code: Any) -> ModeValues:
        """What can be set in each mode, with where it stands in the structs."""
        of_step = {field.name for field in code.parameters} - {"dt", "qdd_prev"}
        specs: list[dict[str, Input]] = []
        for mode, mode_code in zip(self.modes, code.modes, strict=True):
            law = GuidingLaw(self.robot, mode, self.settings).settable
            of_mode = (given for given in mode_code.inputs if given.name in of_step)
            specs.append({given.name: given for given in (*law, *of_mode)})
        places = {
            name: self._view(self._parameters.step if name in of_step else self._parameters, name)
            for name in dict.fromkeys(name for known in specs for name in known)
        }
        return ModeValues(self.modes, specs, places)

    def _view(self, struct: Any, name: str) -> Array:
        address = self._ffi.addressof(struct, name)
        size = self._ffi.sizeof(self._ffi.typeof(address).item)
        return np.frombuffer(self._ffi.buffer(address, size), dtype=np.float64)

    @property
    def mode(self) -> Mode:
        """The mode that is engaged."""
        engaged: int = self._state.mode
        return self.modes[max(engaged, 0)]

    @property
    def phase(self) -> GuidingPhase:
        """What it is doing."""
        return _PHASES[self._state.phase]

    @property
    def reason(self) -> str:
        """Why it stopped; empty unless it did."""
        if self._state.fault:
            return f"{self._state.failures} ticks in a row were not solved"
        return self._reason

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what `set` takes."""
        return self._values.names

    def reset(self) -> None:
        """Begin again: at rest, with the first mode, anchored where the arm will be at the next tick."""
        self._values.put(0)
        self._start(self._parameters, self._state)
        self._input.mode = self._input.stop = 0
        self._reason = ""

    def engage(self, mode: str | Mode) -> None:
        """As `GuidingController.engage`."""
        self._input.mode = index_of_mode(self.modes, mode)
        if self.phase is GuidingPhase.GUIDING:
            # Also for the mode that is engaged: it is anchored anew.
            self._state.phase = _PHASES.index(GuidingPhase.STOPPING)

    def stop(self, reason: str = "asked to") -> None:
        """As `GuidingController.stop`."""
        self._input.stop = 1
        self._reason = reason

    def resume(self) -> None:
        """As `GuidingController.resume`."""
        self._input.stop = self._state.fault = 0
        self._reason = ""

    def set(self, mode: str | Mode | None = None, /, **inputs: ArrayLike) -> None:
        """As `GuidingController.set`: in one mode, or in all that have an input."""
        self._values.set(mode, inputs)

    def __call__(self, q: ArrayLike, wrench: ArrayLike) -> GuidingResult:
        """As `GuidingController.__call__`.

        Raises
        ------
        InputError
            Also naming an input without a default that was not set in the mode that is engaged.
        """
        self._q[:] = checked_array("q", q, self.robot.nv, finite=False)
        self._wrench[:] = checked_array("wrench", wrench, 6, finite=False)
        engaged = self._state.mode
        # The first tick engages the mode that is wanted.
        self._values.write(self._input.mode if engaged < 0 else engaged)
        code = self._tick(self._parameters, self._state, self._input, self._output)
        output = self._output
        mode = self.modes[max(output.mode, 0)]
        results = self._results
        return GuidingResult(
            results["qd"].copy(),
            results["v"][: mode.m_free].copy(),
            results["v_actual"][: mode.m_free].copy(),
            Status.SOLVED if code == 0 else STATUSES[code],
            output.iterations,
            self._active(max(output.mode, 0)) if output.iterations else (),
            mode,
            _PHASES[output.phase],
            results["drift"].copy(),
            bool(output.yielded),
            output.held,
        )

    def _active(self, mode: int) -> tuple[str, ...]:
        rows = self._rows[mode]
        return tuple(
            dict.fromkeys(
                f"{name} {'upper' if side > 0 else 'lower'}"
                for name, side in zip(rows, self._sides[: len(rows)].tolist(), strict=True)
                if side
            )
        )
