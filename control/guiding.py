"""The hand-guiding controller: from the hand's wrench to joint velocities, tick by tick."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..formulations import DEFAULT_DT, Mode
from ..solvers import Status
from .checks import checked_array, checked_modes, checked_period
from .guiding_result import GuidingPhase, GuidingResult
from .guiding_settings import GuidingSettings
from .guiding_unit import GuidingUnit
from .last_command import LastCommand
from .set_inputs import checked_values, index_of_mode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from .loop import AnyStep

    Array = NDArray[np.float64]


class GuidingController:
    """Admittance, drift compensation, motion modes and limits around the steps of a formulation or a baseline.

    - The hand's wrench moves the tool along the guided rows as if it were a mass in oil (`admit`).
    - A mode is engaged at rest: on `engage` the hand loses its effect, the tool comes to rest, its pose is anchored
      and the new mode begins with it. Neither the command nor the pose jumps. `stop` brings it to rest likewise.
    - The locked rows are taken back to the anchor where they drift; where joint limits can't follow that correction,
      it gives way for that tick, and the locked rows stay where they are.
    - Joint velocity limits may be changed at any time: they take effect no faster than the acceleration limits let a
      joint follow.
    - Joint positions can be those of an observer (`observer_gain`), which keeps the encoders' noise out.
    - A tick whose QP is not solved sends the safe stop: braking from the last command, as fast as the acceleration
      limits allow and no faster. So does one whose sample (`q`, wrench) is not finite, after `hold_ticks` for which the
      last one is held. After `max_failures` of both in a row the controller stops, and says why in `reason`.

    Not to be shared between threads. `make_guiding` makes one.

    Parameters
    ----------
    steps : sequence of AnyStep
        One for each mode that can be engaged; the first one's is engaged at the beginning.
    settings : GuidingSettings
    dt : float
        Control period [s].

    Attributes
    ----------
    inputs : tuple of str
        Names of what `set` takes, in one mode or another.

    Raises
    ------
    ValueError
        When there are no steps, or two for one mode, or `dt` is no period.
    """

    def __init__(
        self, steps: Sequence[AnyStep], settings: GuidingSettings | None = None, dt: float = DEFAULT_DT
    ) -> None:
        checked_modes([step.mode for step in steps])
        self.robot: Final = steps[0].robot
        self.settings: Final = settings or GuidingSettings()
        self.dt: Final = checked_period(dt)
        self._units: Final = {str(step.mode): GuidingUnit(step, self.settings, self.dt) for step in steps}
        names = (spec.name for unit in self._units.values() for spec in unit.settable)
        self.inputs: Final = tuple(dict.fromkeys(names))
        self._target: Array = np.array(self.robot.qd_max)
        self.reset()

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Modes that can be engaged."""
        return tuple(unit.mode for unit in self._units.values())

    @property
    def mode(self) -> Mode:
        """The mode that is engaged."""
        return self._unit.mode

    @property
    def phase(self) -> GuidingPhase:
        """What it is doing."""
        return self._phase

    @property
    def reason(self) -> str:
        """Why it stopped; empty unless it did."""
        return self._reason

    def reset(self) -> None:
        """Begin again: at rest, with the first mode, anchored where the arm will be at the next tick."""
        self._phase = GuidingPhase.GUIDING
        self._reason = ""
        self._failures = 0
        self._stop_asked = False
        self._last = LastCommand(self.robot.nv, self.dt)
        self._limit: Array = self._target.copy()
        self._unit = next(iter(self._units.values()))
        self._wanted: GuidingUnit | None = None
        self._v: Array = np.zeros(self._unit.mode.m_free)
        self._anchor: Array | None = None
        self._position: Array | None = None
        self._wrench: Array = np.zeros(6)
        self._held = 0

    def engage(self, mode: str | Mode) -> None:
        """Ask for a mode: the tool is brought to rest, then anchored; the same mode again anchors it anew.

        Raises
        ------
        ValueError
            When it is none of `modes`.
        """
        self._wanted = self._units[str(self.modes[index_of_mode(self.modes, mode)])]
        if self._phase is GuidingPhase.GUIDING:
            self._phase = GuidingPhase.STOPPING

    def stop(self, reason: str = "asked to") -> None:
        """Bring the arm to rest, and stay there until `resume`."""
        self._stop_asked = True
        self._reason = reason
        if self._phase is GuidingPhase.GUIDING:
            self._phase = GuidingPhase.STOPPING

    def resume(self) -> None:
        """Let the hand guide again, once the arm is at rest, anchored where it then is."""
        if self._stop_asked:
            self._stop_asked = False
            self._reason = ""
            self._failures = 0
            self._wanted = self._wanted or self._unit
            self._phase = GuidingPhase.STOPPING

    def set(self, mode: str | Mode | None = None, /, **inputs: ArrayLike) -> None:
        """Change limits, weights, settings, by name (`inputs`), from the next tick on.

        Parameters
        ----------
        mode : str or Mode, optional
            Where they change: in this one of `modes` only; in all that have them, unless told otherwise. What has an
            entry for each guided row, such as `task_weight`, has another shape in each. `qd_max` changes in all.
        **inputs : array_like
            As the steps and `GuidingSettings` take them.

        Raises
        ------
        InputError
            Naming the input that is unknown, of the wrong shape, not finite or out of range; then nothing is changed.
        ValueError
            When the mode is none of `modes`.
        """
        units = list(self._units.values())
        specs = [{spec.name: spec for spec in unit.settable} for unit in units]
        checked = checked_values(self.modes, specs, mode, inputs)
        for index, values in checked.items():
            units[index].check(values)
        for index, values in checked.items():
            for name, value in values.items():
                units[index].set(name, value)
                if name == "qd_max":
                    self._target = value

    def __call__(self, q: ArrayLike, wrench: ArrayLike) -> GuidingResult:
        """Compute the command of one control cycle.

        Parameters
        ----------
        q : array_like, shape (nv,)
            Joint positions [rad or m].
        wrench : array_like, shape (6,)
            Force and torque of the hand on the tool at the tool centre point, world axes [N, N m].

        Raises
        ------
        InputError
            Naming the one that has the wrong shape or no numbers. A sample that is not finite is lost, and no error.
        """
        measured = checked_array("q", q, self.robot.nv, finite=False)
        pull = checked_array("wrench", wrench, 6, finite=False)
        sampled, position = self._sample(measured, pull)
        if not sampled:
            self._count_failure("no sample that is finite")
        if self._held > self.settings.hold_ticks or (not sampled and self._anchor is None):
            return self._brake(position, Status.FAILED)
        if self._anchor is None:
            anchor = self._unit.anchor_at(position)
            if not np.isfinite(anchor).all():
                self._count_failure("no pose that is finite")
                return self._brake(position, Status.FAILED)
            self._anchor = anchor
        if self._phase is not GuidingPhase.GUIDING and not self._v.any():
            self._failures = 0 if sampled else self._failures
            return self._come_to_rest(position)
        stopping = self._phase is GuidingPhase.STOPPING
        asked = self._unit.ask(
            position, self._wrench, self._v, self._anchor, self._last.qd, self._limit, stopping=stopping
        )
        if not all(np.isfinite(values).all() for values in asked):
            if sampled:
                self._count_failure("no finite answer of the law")
            return self._brake(position, Status.FAILED)
        self._limit = asked.qd_limit
        tick = self._unit.step_at(position, asked.v, asked.v_fixed, asked.qd_limit, self._last.qd, self._last.qdd)
        # Limits that leave no way back to the anchor must not keep the hand from moving.
        yielded = tick.status is not Status.SOLVED and bool(asked.v_fixed.any())
        if yielded:
            tick = self._unit.step_at(position, asked.v, None, asked.qd_limit, self._last.qd, self._last.qdd)
        if tick.status is not Status.SOLVED and sampled:
            self._count_failure(tick.status.value)
        if self._unit.is_stop(tick.status):
            stopped = self._brake(position, tick.status)
            return stopped._replace(v=asked.v, iterations=tick.iterations, drift=asked.drift, yielded=yielded)
        self._v = asked.v
        if tick.status is Status.SOLVED and sampled:
            self._failures = 0
        self._last.sent(tick.qd, stop=False)
        return GuidingResult(
            tick.qd,
            asked.v,
            asked.v + tick.eps,
            tick.status,
            tick.iterations,
            tick.active,
            self.mode,
            self._phase,
            asked.drift,
            yielded,
            self._held,
        )

    def _sample(self, measured: Array, pull: Array) -> tuple[bool, Array]:
        """Whether the sample can be used, and the joint positions of this tick.

        One that is not finite is held: the wrench as it was, the arm where the last command has taken it.
        """
        usable = bool(np.isfinite(measured).all() and np.isfinite(pull).all())
        last = self._position
        if usable:
            # After more ticks than are held nothing is expected of the next sample.
            expected = measured if last is None or self._held > self.settings.hold_ticks else last
            position = self._unit.observe(measured, expected, self._last.qd)
            usable = bool(np.isfinite(position).all())
        if usable:
            self._held, self._wrench = 0, pull
        else:
            position = (np.zeros(self.robot.nv) if last is None else last) + self.dt * self._last.qd
            self._held = min(self._held, self.settings.hold_ticks) + 1
        if usable or last is not None:
            self._position = position
        return usable, position

    def _count_failure(self, reason: str) -> None:
        self._failures += 1
        if self._failures == self.settings.max_failures:
            self.stop(f"{self._failures} ticks in a row were not solved, the last one: {reason}")

    def _brake(self, q: Array, status: Status) -> GuidingResult:
        """The safe stop; the hand goes on from what it leaves of the motion."""
        self._brake_from_last(q)
        left = self._unit.guided_velocity(q, self._last.qd)
        self._v = left if np.isfinite(left).all() else np.zeros_like(left)
        nothing = np.zeros_like(left)
        return GuidingResult(
            self._last.qd,
            nothing,
            self._v,
            status,
            0,
            (),
            self.mode,
            self._phase,
            np.zeros(2),
            yielded=False,
            held=self._held,
        )

    def _come_to_rest(self, q: Array) -> GuidingResult:
        """Bring what still moves to rest, then do what was asked for: nothing is asked of the tool any more."""
        assert self._anchor is not None, "anchored at the first tick"  # noqa: S101  # for mypy
        asked = self._unit.ask(q, self._wrench, self._v, self._anchor, self._last.qd, self._limit, stopping=True)
        self._limit = asked.qd_limit
        self._brake_from_last(q)
        done = self._unit
        if not self._last.qd.any():
            if self._stop_asked:
                self._phase = GuidingPhase.STOPPED
            else:
                self._unit = self._wanted or self._unit
                self._wanted = None
                self._phase = GuidingPhase.GUIDING
                self._v = np.zeros(self._unit.mode.m_free)
                self._anchor = self._unit.anchor_at(q)
        zero = np.zeros(done.mode.m_free)
        actual = zero if not self._last.qd.any() else done.guided_velocity(q, self._last.qd)
        return GuidingResult(
            self._last.qd,
            zero,
            actual,
            # A brake goes by its acceleration limits first: after a jump in positions or limits it may not keep these.
            Status.SOLVED if done.keeps_limits(q, self._last.qd, self._limit) else Status.INACCURATE,
            0,
            (),
            done.mode,
            self._phase,
            asked.drift,
            yielded=False,
            held=self._held,
        )

    def _brake_from_last(self, q: Array) -> None:
        self._last.sent(self._unit.brake(q, self._last.qd, self._limit), stop=True)
