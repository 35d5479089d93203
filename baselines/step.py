"""One control cycle of a baseline, behind the interface that formulations have."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from ..formulations import StepResult
from ..solvers import Status
from .situation import Observer

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Mode
    from ..robots import Robot
    from .base import Baseline, Promise, Resolved
    from .situation import Situation

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tolerances:
    """What counts as held; see the constants of the same names in `kinqp.control`."""

    bound: float
    fixed: float
    fixed_floor: float


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
    """

    def __init__(self, robot: Robot, baseline: Baseline, mode: Mode, tolerances: Tolerances) -> None:
        self.robot: Final = robot
        self.mode: Final = mode
        self.baseline: Final = baseline
        self.solver: Final = NoSolver()
        self._tolerances: Final = tolerances
        self._observe: Final = Observer(baseline, robot, mode)

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
        at = self.observe(q, v, **inputs)
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
        states, twists = np.asarray(Q, dtype=float), np.asarray(V, dtype=float)
        if states.ndim != 2 or twists.ndim != 2 or len(states) != len(twists):
            raise ValueError(f"Q and V: expected as many rows in both, got shapes {states.shape}, {twists.shape}")
        return [self(q, v, **inputs) for q, v in zip(states, twists, strict=True)]

    def _judge(self, at: Situation, resolved: Resolved, time: float) -> StepResult:
        qd = resolved.qd
        finite = bool(np.isfinite(qd).all())
        fixed_error = bound_violation = np.inf
        off: dict[Promise, str] = {}
        if finite:
            residual = np.abs(at.J_fixed @ qd - at.v_fixed)
            share = np.abs(at.J_fixed) @ np.abs(qd) + np.abs(at.v_fixed)
            fixed_error = float(np.max(residual, initial=0.0))
            bound_violation = float(np.max(at.over(qd).clip(min=0.0)))
            if bound_violation > self._tolerances.bound:
                off["joint bounds"] = f"a joint exceeds its velocity bound by {bound_violation:.1e}"
            if np.any(residual > self._tolerances.fixed * np.maximum(share, self._tolerances.fixed_floor)):
                off["locked rows"] = f"a locked row is off by {fixed_error:.1e}"
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
            fixed_error=fixed_error,
            bound_violation=bound_violation,
            sigma_min=at.sigma_min(),
            setup_time=0.0,
            solve_time=time,
            message=message,
        )
