"""`cartesian-error` at one state as a family of problems: the hand free, and of the bounds as many as one likes."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...formulations import CartesianError
from ...formulations.inverse import INVERSE_ROUNDING, WIDEST
from .cone import Condition, Decider
from .enumeration import Enumeration, enumerate_paths, united
from .exact import direction
from .method import DualMethod
from .reach import reach

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from ...control import InterpretedStep
    from .exact import Form
    from .method import Side

    Array = NDArray[np.float64]

_SIDES: Final = {"lower": -1, "upper": 1}


class SliceError(ValueError):
    """What is asked to be certified can't be; the message names it and what was expected."""


def parse_side(text: str, nv: int) -> Side:
    """Read one side of a joint, as `3:lower`; joints count from 0.

    Raises
    ------
    SliceError
        Naming what was given.
    """
    joint, _, side = text.partition(":")
    if side not in _SIDES or not joint.isdecimal() or int(joint) >= nv:
        raise SliceError(
            f"free side: expected a joint from 0 to {nv - 1} and a side, as 3:lower or 3:upper, got {text!r}"
        )
    return int(joint), _SIDES[side]


@dataclass(frozen=True, eq=False)
class Piece:
    """Theta of a slice for which the bounds are linear in theta: the hand's signs are the same.

    Attributes
    ----------
    method : DualMethod
        The active set on these problems.
    given : tuple of Condition
        Which theta there are; no other piece of the slice holds any of them.
    """

    method: DualMethod
    given: tuple[Condition, ...]

    def holds(self, theta: Form) -> bool:
        """Whether a theta belongs to it, exactly."""
        return all(condition.holds(theta) for condition in self.given)


@dataclass(frozen=True, eq=False)
class Slice:
    """The problems minimise 1/2 |w|^2 subject to qd_lo - r <= M (v + w) <= qd_hi + r of one M.

    theta = (v, s, b): the hand [m/s, rad/s], a factor of all bounds, and the bounds of the free sides. Only its
    direction counts, since v, bounds and answer scale together. At s = 1 the bounds of all other sides are the state's
    own. r is what the declaration widens them by for J#'s rounding (`rounding_of_inverse`): in proportion to
    |v_1| + ... + |v_m|, and no more than `WIDEST` s. That is linear where no v_i changes its sign: in each `Piece`.

    Attributes
    ----------
    step : InterpretedStep
        `cartesian-error` on a robot in a mode.
    q : ndarray, shape (nv,)
        The state [rad or m].
    limits : mapping of str to ndarray
        Run-time inputs in place of the robot's own limits.
    free : tuple of (int, int)
        Joints and sides (-1 lower, +1 upper) whose bound may be anything from 0 to the joint's velocity limit, as if
        its position limit stood anywhere from here to far away.
    speed : float or None
        Largest speed of the hand along each of its axes, where bounds are as they are [m/s, rad/s]; None: any.
    """

    step: InterpretedStep
    q: Array
    limits: Mapping[str, Array] = field(default_factory=dict)
    free: tuple[Side, ...] = ()
    speed: float | None = None

    def __post_init__(self) -> None:
        """Refuse what is no such family.

        Raises
        ------
        SliceError
            Naming what was expected.
        """
        made = self.step.formulation
        if type(made) is not CartesianError:
            raise SliceError(f"formulation: expected cartesian-error, whose J# alone decides, got {made.name}")
        if self.speed is not None and not 0.0 < self.speed < np.inf:
            raise SliceError(f"speed: expected more than 0 m/s, got {self.speed}")
        if len(set(self.free)) < len(self.free):
            raise SliceError(f"free sides: expected each once, got {self.free}")
        other = set(self.limits) - {"q_min", "q_max", "qd_max", "qdd_max", "dt"}
        if other:
            raise SliceError(f"limits: expected q_min, q_max, qd_max, qdd_max or dt, got {', '.join(sorted(other))}")

    @cached_property
    def _instance(self) -> Any:
        return self.step.evaluate(self.q, np.zeros(self.step.mode.m_free), **self.limits)

    @property
    def M(self) -> Array:
        """J#, shape (nv, m_free)."""
        return np.asarray(self._instance.K)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper joint velocity bounds of the state, shape (nv,) [rad/s or m/s]."""
        return self._instance.qd_lo, self._instance.qd_hi

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """Parts, by the hand's signs and by whether bounds are as wide as they get; each theta is in one."""
        m, size = self.step.mode.m_free, self.step.mode.m_free + 1 + len(self.free)
        most, found = _form(size, {m: WIDEST}), []
        for signs in product((1.0, -1.0), repeat=m):
            # Zero is taken for positive.
            here = [_condition(size, {axis: sign}, strict=sign < 0.0) for axis, sign in enumerate(signs)]
            wider = _form(size, {axis: INVERSE_ROUNDING * sign for axis, sign in enumerate(signs)})
            slower, faster = Condition.exactly(most - wider, strict=False), Condition.exactly(wider - most, strict=True)
            found.append(Piece(self._widened(wider), (*self._given, *here, slower)))
            beyond = (*self._given, *here, faster)
            if Decider().witness((), beyond) is not None:  # else no hand of the slice is that fast
                found.append(Piece(self._widened(most), beyond))
        return tuple(found)

    def enumerate(self, on_progress: Callable[[int, int, float], None] | None = None) -> Enumeration:
        """Follow every path of every piece; arguments and errors as of `enumerate_paths`."""
        parts: list[Enumeration] = []
        for piece in self.pieces:

            def told(regions: int, most: int, share: float, before: tuple[Enumeration, ...] = tuple(parts)) -> None:
                if on_progress is not None:
                    known = sum(len(part.regions) for part in before)
                    most = max([most, *(part.iterations for part in before)])
                    on_progress(known + regions, most, (len(before) + share) / len(self.pieces))

            parts.append(enumerate_paths(piece.method, piece.given, told))
        return united(parts)

    def method(self, theta: Form) -> DualMethod:
        """Give the active set on the problems of a theta's piece.

        Raises
        ------
        SliceError
            When it belongs to none, as where the hand is faster than `speed`.
        """
        for piece in self.pieces:
            if piece.holds(theta):
                return piece.method
        raise SliceError(f"theta: expected one of the slice, got the direction {direction(theta)}")

    def _widened(self, widening: Array) -> DualMethod:
        columns = 1 + len(self.free)
        low, high = (np.hstack([side[:, None], np.zeros((side.size, columns - 1))]) for side in self.bounds)
        for k, (joint, sign) in enumerate(self.free):
            side = low if sign < 0 else high
            side[joint] = 0.0
            side[joint, 1 + k] = sign
        return DualMethod(self.M, low, high, widening)

    @cached_property
    def _given(self) -> tuple[Condition, ...]:
        m = self.step.mode.m_free
        size = m + 1 + len(self.free)
        found = [_condition(size, {m: 1.0}, strict=True)]
        for axis in range(m if self.speed is not None else 0):
            found += [_condition(size, {m: self.speed or 0.0, axis: sign}) for sign in (-1.0, 1.0)]
        fastest = self.limits.get("qd_max", self.step.robot.qd_max)
        for k, (joint, _) in enumerate(self.free):
            found.append(_condition(size, {m + 1 + k: 1.0}))
            found.append(_condition(size, {m: float(fastest[joint]), m + 1 + k: -1.0}))
        return tuple(found)

    def inputs(self, theta: Array) -> tuple[Array, dict[str, Array]]:
        """Give the hand and the run-time inputs with which a step at `q` meets a theta, scaled to s = 1.

        Free bounds come about by position limits at the distance that gives them, to rounding.
        """
        m, robot = self.step.mode.m_free, self.step.robot
        scaled = theta / theta[m]
        inputs = dict(self.limits)
        if self.free:
            given = {"q_min": robot.q_min, "q_max": robot.q_max, "qd_max": robot.qd_max, "qdd_max": robot.qdd_max}
            given |= inputs
            ends = {-1: given["q_min"].copy(), 1: given["q_max"].copy()}
            dt = float(inputs.get("dt", 1e-3))
            for (joint, sign), bound in zip(self.free, scaled[m + 1 :], strict=True):
                far = reach(self.step.formulation.bounds, float(bound), float(given["qdd_max"][joint]), dt)
                ends[sign][joint] = self.q[joint] + sign * far
            inputs |= {"q_min": ends[-1], "q_max": ends[1]}
        return scaled[:m], inputs

    def theta(self, v: Array, inputs: Mapping[str, Array]) -> Array:
        """Give the theta that a step at `q` meets under a hand and run-time inputs, the inverse of `inputs`."""
        instance = self.step.evaluate(self.q, v, **inputs)
        bounds = [abs((instance.qd_lo if sign < 0 else instance.qd_hi)[joint]) for joint, sign in self.free]
        return np.array([*v, 1.0, *bounds])


def _form(size: int, entries: Mapping[int, float]) -> Array:
    values = np.zeros(size)
    values[list(entries)] = list(entries.values())
    return values


def _condition(size: int, entries: Mapping[int, float], *, strict: bool = False) -> Condition:
    return Condition.exactly(_form(size, entries), strict=strict)


def every_bound(M: Array) -> tuple[DualMethod, tuple[Condition, ...]]:
    """Give the method on one M where all bounds are free, and which theta there are: 0 <= b.

    theta = (v, b): the hand, -qd_lo and qd_hi. Everything about one M, then; fit for a few rows.

    Parameters
    ----------
    M : ndarray, shape (nv, m_free)
    """
    nv, m = M.shape
    nothing, all_ = np.zeros((nv, nv)), np.eye(nv)
    given = tuple(_condition(m + 2 * nv, {m + k: 1.0}) for k in range(2 * nv))
    return DualMethod(M, np.hstack([-all_, nothing]), np.hstack([nothing, all_])), given
