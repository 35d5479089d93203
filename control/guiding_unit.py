"""One mode of a hand-guiding controller: its law and its step, in numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from ..formulations import Limits, unmet_limits
from ..formulations.buffered import BufferedFunction
from .guiding_law import GuidingLaw
from .last_command import is_stop
from .set_inputs import check_order

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..formulations import Input
    from ..solvers import Status
    from .guiding_settings import GuidingSettings
    from .loop import AnyStep, Command

    Array = NDArray[np.float64]

# Given to a step by the controller, tick by tick.
_GIVEN: Final = ("q", "v", "v_fixed", "qd_prev", "qdd_prev", "dt")


class Asked(NamedTuple):
    """What the law asks of the step; as in `GuidingLaw.law`."""

    v: Array
    v_fixed: Array
    qd_limit: Array
    drift: Array


class GuidingUnit:
    """A mode's law and step.

    Parameters
    ----------
    step : AnyStep
    settings : GuidingSettings
    dt : float
        Control period [s].
    """

    def __init__(self, step: AnyStep, settings: GuidingSettings, dt: float) -> None:
        law = GuidingLaw(step.robot, step.mode, settings)
        self.mode: Final = step.mode
        self._dt: Final = dt
        self._step: Final = step
        self._law: Final = BufferedFunction("law", law.symbols_of(law.law), law.law)
        self._observed: Final = BufferedFunction("observed", law.symbols_of(law.observed), law.observed)
        self._anchor: Final = BufferedFunction("anchor", law.symbols_of(law.anchor), law.anchor)
        self._guided: Final = BufferedFunction("guided", law.symbols_of(law.guided), law.guided)
        self._brake: Final = BufferedFunction("brake", law.symbols_of(law.brake), law.brake)
        self._values: Final = {given.name: given.default for given in law.settable if given.default is not None}
        for name, default in {**self._values, "dt": np.array([dt])}.items():
            self._put(name, default)
        self._remembers: Final = "qd_prev" in step.inputs
        self._remembers_change: Final = "qdd_prev" in step.inputs
        self._specs: Final = {spec.name: spec for spec in (*law.settable, *step.specs) if spec.name not in _GIVEN}
        # What differs from the step's own defaults; looking at inputs takes longer than a compiled tick.
        self._own: Final = {spec.name: spec.default for spec in step.specs}
        self._extra: dict[str, Array] = {} if _same(self._own["dt"], np.array([dt])) else {"dt": np.array([dt])}

    @property
    def settable(self) -> tuple[Input, ...]:
        """What `set` takes."""
        return tuple(self._specs.values())

    def check(self, inputs: Mapping[str, Array]) -> None:
        """See that inputs that belong together make sense together.

        Raises
        ------
        InputError
            When a lower position limit lies above the upper one.
        """
        check_order(inputs, self._values)

    def set(self, name: str, values: Array) -> None:
        """Change an input of the law, the step or both; one that this mode does not have is left out."""
        if name in self._values:
            self._values[name] = values
            self._put(name, values)
        if name in self._own and name != "qd_max":
            self._extra[name] = values

    def observe(self, measured: Array, last: Array, qd_prev: Array) -> Array:
        """Joint positions of this tick, shape (nv,), from those of the last one."""
        for name, values in (("q", measured), ("q_observed", last), ("qd_prev", qd_prev)):
            self._observed.given[name][:] = values
        self._observed()
        return self._observed.results["observed"][:, 0].copy()

    def anchor_at(self, q: Array) -> Array:
        """Pose at `q`, shape (12,), as `ask` takes it."""
        self._anchor.given["q"][:] = q
        self._anchor()
        return self._anchor.results["anchor"][:, 0].copy()

    def ask(
        self,
        q: Array,
        wrench: Array,
        v: Array,
        anchor: Array,
        qd_prev: Array,
        qd_limit: Array,
        *,
        stopping: bool,
    ) -> Asked:
        """Evaluate the law; arguments as in `GuidingLaw`."""
        given = self._law.given
        handed = {
            "q": q,
            "wrench": wrench,
            "hand_velocity": v,
            "anchor": anchor,
            "qd_prev": qd_prev,
            "qd_limit": qd_limit,
            "stopping": np.array([float(stopping)]),
        }
        for name, values in handed.items():
            # Without locked rows there is no anchor in it.
            if name in given:
                given[name][:] = values
        self._law()
        results = self._law.results
        return Asked(*(results[name][:, 0].copy() for name in Asked._fields))

    def step_at(
        self, q: Array, v: Array, v_fixed: Array | None, qd_limit: Array, qd_prev: Array, qdd_prev: Array
    ) -> Command:
        """Compute the command; without `v_fixed` the locked rows stay where they are."""
        inputs = dict(self._extra)
        if v_fixed is not None and v_fixed.any():
            inputs["v_fixed"] = v_fixed
        if not _same(self._own["qd_max"], qd_limit):
            inputs["qd_max"] = qd_limit
        if self._remembers:
            inputs["qd_prev"] = qd_prev
        if self._remembers_change:
            inputs["qdd_prev"] = qdd_prev
        return self._step(q, v, **inputs)

    def is_stop(self, status: Status) -> bool:
        """Whether a command of this status is the step's own safe stop."""
        return is_stop(self._step, status)

    def brake(self, q: Array, qd_prev: Array, qd_limit: Array) -> Array:
        """Fastest admissible braking, shape (nv,)."""
        for name, values in (("q", q), ("qd_prev", qd_prev), ("qd_limit", qd_limit)):
            self._brake.given[name][:] = values
        self._brake()
        return self._brake.results["qd"][:, 0].copy()

    def keeps_limits(self, q: Array, qd: Array, qd_limit: Array) -> bool:
        """Whether a command keeps the limits of position and speed."""
        q_min, q_max, qdd_max = (self._values[name] for name in ("q_min", "q_max", "qdd_max"))
        return not unmet_limits(qd, Limits(q, q_min, q_max, qd_limit, qdd_max, self._dt), sampled=True)

    def guided_velocity(self, q: Array, qd: Array) -> Array:
        """Velocity along the guided rows, shape (m_free,) [m/s, rad/s]."""
        self._guided.given["q"][:] = q
        self._guided.given["qd_prev"][:] = qd
        self._guided()
        return self._guided.results["v"][:, 0].copy()

    def _put(self, name: str, values: Array) -> None:
        for function in (self._law, self._brake, self._observed):
            if name in function.given:
                function.given[name][:] = values


def _same(default: Array | None, values: Array) -> bool:
    return default is not None and np.array_equal(default, values)
