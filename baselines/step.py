"""One control cycle of a baseline, behind the interface that formulations have."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from ..formulations import CommandCheck, StepResult, one_by_one
from ..solvers import Status
from .situation import Observer

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Input, Mode
    from ..robots import Robot
    from .base import Baseline, Promise, Resolved
    from .situation import Situation

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoSolver:
    """Stands where a formulation's step has its solver: a closed form has none."""

    name: ClassVar[str] = "-"

    def reset(self) -> None:
        """Do nothing: there is no set-up to forget."""


class BaselineStep:
    """A baseline on a robot in a mode, called once per control period.

    `status` of a result says whether the method did what it promises (`Baseline.promises`):

    - SOLVED: the command is the method's own and is finite; the joint bounds and the locked rows hold as far as it
      promises them. Where it exceeds one that it does not promise, `bound_violation` and `fixed_error` say by how much
      and `message` says so in words; the command is sent as it is.
    - INACCURATE: a promise is broken, by rounding or because the state leaves no way to keep it, or the command is not
      finite. The command is the safe stop, zero velocity; `bound_violation` and `fixed_error` are those of what was
      refused.

    Not to be shared between threads.

    Attributes
    ----------
    situation : Situation or None
        What was resolved in the last call: the evidence behind its result.
    """

    def __init__(self, robot: Robot, baseline: Baseline, mode: Mode) -> None:
        self.robot: Final = robot
        self.mode: Final = mode
        self.baseline: Final = baseline
        self.solver: Final = NoSolver()
        self._observe: Final = Observer(baseline, robot, mode)
        self.situation: Situation | None = None

    @property
    def specs(self) -> tuple[Input, ...]:
        """What a call takes: `q`, `v` and the run-time inputs, with their sizes, defaults and ranges."""
        return self._observe.inputs

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the run-time inputs, beyond `q` and `v`, that a call takes by keyword."""
        return tuple(given.name for given in self._observe.inputs if given.name not in ("q", "v"))

    def observe(self, q: ArrayLike, v: ArrayLike, **inputs: ArrayLike) -> Situation:
        """Give what the baseline sees at a state, without resolving it; arguments as in a call."""
        return self._observe({"q": q, "v": v, **inputs})

    def __call__(self, q: ArrayLike, v: ArrayLike, **inputs: ArrayLike) -> StepResult:
        """Compute the command.

        Parameters
        ----------
        q : array_like, shape (nv,)
            Joint positions [rad or m].
        v : array_like, shape (m_free,)
            Velocity that the hand asks for, along the mode's axes [m/s, rad/s].
        **inputs : array_like
            Any of `inputs`: limits, gains, `dt`, `v_fixed`, ...; each for this call only.

        Raises
        ------
        InputError
            Naming the input that is unknown, missing, of the wrong shape, not finite or out of range.
        """
        self.situation = at = self.observe(q, v, **inputs)
        start = perf_counter()
        resolved = self.baseline.resolve(at)
        return self._judge(at, resolved, perf_counter() - start)

    def batch(self, Q: ArrayLike, V: ArrayLike, **inputs: ArrayLike) -> list[StepResult]:
        """Compute the commands of many states, one after the other.

        Parameters
        ----------
        Q : array_like, shape (N, nv)
            Joint positions [rad or m].
        V : array_like, shape (N, m_free)
            Velocities that the hand asks for [m/s, rad/s].
        **inputs : array_like
            As in a call, the same for all states.
        """
        return one_by_one(self, Q, V, inputs)

    def _judge(self, at: Situation, resolved: Resolved, time: float) -> StepResult:
        qd = resolved.qd
        finite = bool(np.isfinite(qd).all())
        kept = CommandCheck.of(qd, at.J_fixed, at.v_fixed, at.qd_lo, at.qd_hi)
        found: dict[Promise, str] = {"joint bounds": kept.joint_bounds, "locked rows": kept.locked_rows}
        off = {promise: text for promise, text in found.items() if text}
        broken = [text for promise, text in off.items() if promise in self.baseline.promises]
        solved = finite and not broken
        if solved:
            message = "; ".join(f"{text}, as this method may" for text in off.values())
        else:
            message = "; ".join(broken) if finite else "the command is not finite"
        command = qd if solved else np.zeros(at.nv)
        return StepResult(
            qd=command,
            eps=at.J_free @ command - at.v,
            status=Status.SOLVED if solved else Status.INACCURATE,
            iterations=resolved.iterations,
            active=resolved.active if solved else (),
            fixed_error=kept.fixed_error,
            bound_violation=kept.bound_violation,
            sigma_min=at.sigma_min() if resolved.sigma_min is None else resolved.sigma_min,
            setup_time=0.0,
            solve_time=time,
            message=message,
        )
