"""What a cell's answers were worth and what the arm did with them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from ...solvers import Status
from .motion import JUMP_SHARE, ON_LIMIT, sign_changes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .ticks import Ticks

    Array = NDArray[np.float64]

# Commands closer than this to the reference's agree with it [rad/s or m/s]: below what a drive resolves.
AGREEMENT: Final = 1e-6
_UNSOLVABLE: Final = (Status.PRIMAL_INFEASIBLE.value, Status.DUAL_INFEASIBLE.value)


@dataclass(frozen=True)
class Iterations:
    """How much the solver had to do.

    Attributes
    ----------
    iterations_mean, iterations_p99, iterations_max : float
        Per tick, as the solver counts them; None where it tells none.
    changes_mean, changes_p99, changes_max : float
        Rows that joined or left the active set from one tick to the next; None of a sample, whose ticks are far apart.
    """

    iterations_mean: float | None
    iterations_p99: float | None
    iterations_max: float | None
    changes_mean: float | None
    changes_p99: float | None
    changes_max: float | None

    @classmethod
    def of(cls, ticks: Ticks) -> Iterations:
        """Sum up a cell's ticks."""
        counts = ticks.column("iterations")
        known = not np.isnan(counts).any()
        active = [frozenset(names or ()) for names in ticks.frame["active"].to_list()]
        in_order = [] if ticks.loop == "sampled" else pairwise(active)
        changes = np.array([len(a ^ b) for a, b in in_order], dtype=float)
        return cls(*_mean_p99_max(counts if known else np.zeros(0)), *_mean_p99_max(changes))


@dataclass(frozen=True)
class Answers:
    """Success and honesty: shares of ticks.

    Attributes
    ----------
    success : float
        Judged to be the scenario's right answer: solved, by residuals that we compute, or proved infeasible where that
        is what is expected.
    false_solved : float
        Claimed solved by the solver, and was not.
    false_unsolvable : float
        The reverse: claimed to have no solution where the scenario's right answer is one.
    gave_up : float
        Ended by the solver's own account without an answer: iterations used up, inaccurate, failed.
    agreement : float
        Commands within `AGREEMENT` of the reference's on the same QP, of those compared.
    compared : float
        With a reference to compare with.
    reference_error_p99, reference_error_max : float
        Largest difference of a joint's command to the reference's [rad/s or m/s].
    """

    success: float
    false_solved: float
    false_unsolvable: float
    gave_up: float
    agreement: float | None
    compared: float
    reference_error_p99: float | None
    reference_error_max: float | None

    @classmethod
    def of(cls, ticks: Ticks) -> Answers:
        """Sum up a cell's ticks."""
        status, claimed = ticks.words("status"), ticks.words("claimed")
        error = ticks.column("reference_error")
        error = error[np.isfinite(error)]
        solvable = ticks.scenario.expects is Status.SOLVED
        unsolvable = np.isin(claimed, _UNSOLVABLE)
        solved = claimed == Status.SOLVED.value
        _, p99, largest = _mean_p99_max(error)
        return cls(
            success=float(np.mean(status == ticks.scenario.expects.value)),
            false_solved=float(np.mean(solved & (status != Status.SOLVED.value))),
            false_unsolvable=float(np.mean(unsolvable)) if solvable else 0.0,
            gave_up=float(np.mean(~solved & ~unsolvable)),
            agreement=float(np.mean(error <= AGREEMENT)) if error.size else None,
            compared=error.size / len(status),
            reference_error_p99=p99,
            reference_error_max=largest,
        )


@dataclass(frozen=True)
class Errors:
    """Residuals in physical units, and what of the hand's motion was not made.

    Attributes
    ----------
    proposed_excess : float
        Largest excess over a joint's velocity bound of what the solver proposed, refused proposals included [rad/s or
        m/s]; of those that were finite.
    proposed_fixed_error : float
        Largest error of a locked row of the same [m/s, rad/s].
    not_finite : float
        Share of ticks whose proposal was not finite.
    sent_excess : float
        Largest excess of what was sent [rad/s or m/s].
    off_line : float
        Largest velocity sent along a locked translation: m/s off the line [m/s].
    off_orientation : float
        Largest velocity sent about a locked axis [rad/s].
    drift_offset, drift_turn : float or None
        Furthest that the tool was from what its mode locks, since the mode began [m; rad]; None without a closed loop.
    task_error_linear, task_error_angular : float
        Mean norm of the Cartesian error's translations [m/s] and rotations [rad/s]; None where none is guided.
    task_scale_loss : float
        Mean share of the hand's velocity that is not made, over ticks at which it pulls [-].
    time_lost : float
        The same summed up over time: how far the tool is behind the hand in the end [s].
    """

    proposed_excess: float | None
    proposed_fixed_error: float | None
    not_finite: float
    sent_excess: float
    off_line: float
    off_orientation: float
    drift_offset: float | None
    drift_turn: float | None
    task_error_linear: float | None
    task_error_angular: float | None
    task_scale_loss: float | None
    time_lost: float | None

    @classmethod
    def of(cls, ticks: Ticks) -> Errors:
        """Sum up a cell's ticks."""
        excess, fixed = ticks.column("bound_violation"), ticks.column("fixed_error")
        finite = np.isfinite(excess) & np.isfinite(fixed)
        over = np.maximum(ticks.qd - ticks.column("qd_hi"), ticks.column("qd_lo") - ticks.qd)
        scale = ticks.column("task_scale")[ticks.pulling]
        loss = 1.0 - scale[np.isfinite(scale)]
        guided = {row for mode in ticks.scenario.modes for row in mode.free_rows}
        linear, angular = (float(np.mean(np.linalg.norm(ticks.eps[:, k : k + 3], axis=1))) for k in (0, 3))
        return cls(
            proposed_excess=float(np.max(excess[finite])) if finite.any() else None,
            proposed_fixed_error=float(np.max(fixed[finite])) if finite.any() else None,
            not_finite=float(np.mean(~finite)),
            sent_excess=float(np.max(over, initial=0.0)),
            off_line=float(np.max(ticks.locked.linear)),
            off_orientation=float(np.max(ticks.locked.angular)),
            drift_offset=float(np.max(ticks.locked.offset)) if ticks.closed_loop else None,
            drift_turn=float(np.max(ticks.locked.turn)) if ticks.closed_loop else None,
            task_error_linear=linear if guided & {0, 1, 2} else None,
            task_error_angular=angular if guided & {3, 4, 5} else None,
            task_scale_loss=float(np.mean(loss)) if loss.size else None,
            time_lost=float(np.sum(loss) * ticks.scenario.dt) if loss.size and ticks.closed_loop else None,
        )


@dataclass(frozen=True)
class Motion:
    """What the joints did. All but the first three are None where it was no closed loop.

    Attributes
    ----------
    peak_speed : float
        Largest joint velocity over its limit [-].
    sigma_min : float
        Smallest singular value of the guided rows met [m or rad].
    limit_overshoot : float
        Furthest that a joint went beyond a position limit, from where it was before [rad or m].
    peak_acceleration, watched_acceleration : float
        Largest joint acceleration over its limit, of all joints and of the watched ones [-].
    chatter : float
        Sign changes of joint accelerations with both sides above 1 % of the limit [1/s].
    jumps : float
        Ticks at which a joint's command changes by more than twice qdd_max dt [1/s].
    largest_jump : float
        Largest change of a joint's command from one tick to the next [rad/s or m/s].
    on_limit : float
        Share of ticks with a watched joint within 1e-6 of a limit.
    closest : float
        Smallest distance of a watched joint to a limit, negative beyond it [rad or m].
    """

    peak_speed: float
    sigma_min: float
    limit_overshoot: float
    peak_acceleration: float | None
    watched_acceleration: float | None
    chatter: float | None
    jumps: float | None
    largest_jump: float | None
    on_limit: float | None
    closest: float | None

    @classmethod
    def of(cls, ticks: Ticks) -> Motion:
        """Sum up a cell's ticks."""
        first = (
            float(np.max(np.abs(ticks.qd) / ticks.limit("qd_max"))),
            float(np.min(ticks.column("sigma_min"))),
            ticks.overshoot,
        )
        if not ticks.closed_loop:
            return cls(*first, *[None] * 7)
        size, duration = np.abs(ticks.acceleration), ticks.scenario.duration
        watched = list(ticks.scenario.watched_joints)
        near = ticks.distance[:, watched]
        return cls(
            *first,
            peak_acceleration=float(np.max(size)),
            watched_acceleration=float(np.max(size[:, watched])) if watched else None,
            chatter=sign_changes(ticks.acceleration) / duration,
            jumps=float(np.sum(np.any(size > JUMP_SHARE, axis=1)) / duration),
            largest_jump=float(np.max(np.abs(ticks.qd - ticks.qd_before))),
            on_limit=float(np.mean(np.any(near <= ON_LIMIT, axis=1))) if watched else None,
            closest=float(np.min(near)) if watched else None,
        )


def _mean_p99_max(values: Array) -> tuple[float | None, float | None, float | None]:
    if not values.size:
        return None, None, None
    return float(values.mean()), float(np.percentile(values, 99, method="inverted_cdf")), float(values.max())
