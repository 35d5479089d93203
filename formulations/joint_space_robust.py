"""`joint-space-robust`: `joint-space` that stays calm near singularities, the thesis's open end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca

from ..solvers.options import flag
from .base import Formulation
from .rate import kept_share, limit_rate, needed_slacks, rate_window, scaled_last_command, smoothing_time
from .singularity import damping, governor, pull

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick


# Ten times that of `joint-space`: with less, a joint that runs into its limit at speed sets the self-motion swinging
# (docs/singularities.md). It takes 1 % off the hand's speed where singular values are 0.3, 0.4 % at 0.5.
ROBUST_JOINT_WEIGHT: Final = 1e-3
_PARTS: Final = ("damping", "pull", "rate_limit", "smoothing", "governor", "jerk")


@dataclass(frozen=True)
class JointSpaceRobust(Formulation):
    r"""`joint-space` with damping, a way out of singularities, and limited accelerations (thesis 4.5.4 left it open).

    .. math::
        \min_{\varepsilon, \dot q, s}\ \tfrac12\,|\varepsilon - \varphi\,\varepsilon_{prev}|_W^2
        + \tfrac12\,|\dot q - \varphi\,\dot q_{prev} - (1 - \varphi)\,\dot q_{pull}|_{W_q + \lambda^2}^2 + p\,s
        \quad\text{s.t.}\quad J_{free}\,\dot q - \varepsilon = v,\quad J_{fixed}\,\dot q = v_{fixed},

        \dot q_{lo} \le \dot q \le \dot q_{hi},\quad
        \dot q_{prev} - (1 + s)\,a\,dt \le \dot q \le \dot q_{prev} + (1 + s)\,a\,dt,\quad s \ge 0

    - **Damping**, :math:`\lambda^2`, grows below `damping_threshold` as the guided rows J_bar lose rank (`damping`). It
      is on the joint velocities, never on the locked rows, which hold exactly.
    - **Pull**: what damping draws to is not zero but :math:`\dot q_{pull}`, up the gradient of the smallest
      singular value in proportion to the hand's pull along the singular direction (`pull`). Damped alone, a stretched
      arm sticks.
    - **Rate limit**: accelerations stay within `qdd_max`. Where the locked rows or the limits of position and velocity
      don't allow that, it yields, by the variable `excess`, s above (`limit_rate`); those never do.
    - **Jerk limit**: accelerations change by `qdd_max` within `jerk_time`, no faster, as long as the last one is given
      as `qdd_prev`. It and the gentle approach to limits that comes with smoothing yield first, by the variable
      `haste`, which costs less than `excess` (`rate_window`).
    - **Smoothing**: the error of the last command, :math:`\varepsilon_{prev} = J_{free}\,\dot q_{prev} - v`, decays
      with a time constant instead of at once, :math:`\varphi = \tau/(\tau + dt)`, the longer the more acceleration
      the hand's speed needs (`smoothing_time`). The
      acceleration is then as continuous as the QP's data, with no memory but `qd_prev`; joints approach their limits
      in the same way.
    - **Governor**: near singularities the hand's speed is reduced such that its rows, and the locked ones above all,
      leave the joints enough acceleration (`governor`): v stands for its governed share throughout.

    Zero motion, with :math:`\dot q` that of the drift correction, is feasible at every state within the limits. Each of
    the six can be left out; without all of them this is `joint-space`. docs/singularities.md compares them.

    Parameters
    ----------
    damping, pull, rate_limit, smoothing, governor, jerk : bool
        Which of the six to use; the pull needs the damping, the jerk limit the rate limit.

    Run-time parameters
    -------------------
    task_weight : shape (m_free,)
        W's diagonal, 1 unless told otherwise.
    joint_weight : shape (nv,)
        W_q's diagonal, `ROBUST_JOINT_WEIGHT` unless told otherwise.
    damping_threshold, damping_max
        sigma_0 and lambda_max [m or rad], 0.2 and 0.12.
    pull_gain
        Speed of the pull over the hand's speed [1/m], 2.
    smoothing_time, smoothing_stretch
        tau at rest, and what the need of all of `qdd_max` adds to it (with the governor only) [s], 0.02 and 0.05.
    qdd_prev : shape (nv,)
        Last accelerations, (qd_prev - the command before) / dt [rad/s^2 or m/s^2]; infinite, unknown, unless told
        otherwise: then jerk is not limited.
    jerk_time, limit_time
        From no acceleration to `qdd_max`; least time constant with which limits are approached [s], 0.06 and 0.1.
    excess_price, haste_price
        p, and what haste costs in its place [m^2/s^2], 10 and 0.1.
    governor_share
        Largest share of `qdd_max` that the locked rows may take up [-], 0.3.
    """

    damping: bool = True
    pull: bool = True
    rate_limit: bool = True
    smoothing: bool = True
    governor: bool = True
    jerk: bool = True

    name: ClassVar[str] = "joint-space-robust"

    def __post_init__(self) -> None:
        """Read options that came as words; refuse a pull without damping, a jerk limit without a rate limit."""
        super().__post_init__()
        for option in _PARTS:
            object.__setattr__(self, option, flag(option, getattr(self, option)))
        if self.pull and not self.damping:
            raise ValueError("pull: expected damping, which the pull takes the place of, got damping=False")
        if self.jerk and not self.rate_limit:
            raise ValueError("jerk: expected rate_limit, whose window it narrows, got rate_limit=False")

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        eps = qp.variable("eps", tick.m_free)
        qd = qp.variable("qd", tick.nv)
        task_weight = tick.parameter("task_weight", 1.0, size=tick.m_free, lowest=0.0, positive=True)
        weight = tick.parameter("joint_weight", ROBUST_JOINT_WEIGHT, size=tick.nv, lowest=0.0, positive=True)
        measured = damping(tick) if self.damping or self.governor else None
        v, need = tick.v, ca.SX(0)
        if self.governor and measured:
            share, need = governor(tick, measured)
            v = tick.v * share
        tau = smoothing_time(tick, need) if self.smoothing else None
        keep = kept_share(tick, tau) if tau is not None else ca.SX(0)
        # Both before the error and before the velocity: what the term would be zero at.
        slowed, wish = v - tick.v, ca.SX(tick.nv, 1)
        if self.damping and measured:
            if self.pull:
                wish = measured.lambda2 / (weight + measured.lambda2) * pull(tick, measured)
            weight = weight + measured.lambda2
        if self.smoothing:
            slowed = (1 - keep) * slowed + keep * (tick.J_free @ tick.qd_prev - tick.v)
            wish = (1 - keep) * wish + keep * tick.qd_prev
        qp.minimize(eps - slowed, weight=task_weight, name="Cartesian error")
        qp.minimize(qd - wish, weight=weight, name="joint speed")
        qp.equal(tick.J_free @ qd - eps, tick.v, name="task")
        qp.equal(tick.J_fixed @ qd, tick.v_fixed, name="mode")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)
        start = {"qd": tick.qd_fixed}
        if self.rate_limit:
            window = rate_window(tick, tau, jerk=self.jerk)
            limit_rate(qp, tick, qd, window)
            start["qd"] = tick.qd_fixed + scaled_last_command(tick)
            start |= needed_slacks(window, start["qd"])
        qp.feasible(eps=tick.J_free @ start["qd"] - tick.v, **start)
