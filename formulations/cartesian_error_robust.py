"""`cartesian-error-robust`: `cartesian-error` with a way out of singularities and limited accelerations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import casadi as ca

from .algebra import matmul
from .base import Formulation
from .rate import continued, kept_share, limit_rate, needed_slacks, rate_window, smoothing_time
from .singularity import damping, governor, pull

if TYPE_CHECKING:
    from .program import QuadraticProgram
    from .tick import Tick

# The share of the motion outside J#'s range matters this little beside a Cartesian error of 1 m/s.
OUTSIDE_WEIGHT: Final = 1e-2


@dataclass(frozen=True)
class CartesianErrorRobust(Formulation):
    r"""Smallest Cartesian error beside a calm motion that is known before the QP (thesis 4.5.2, made robust).

    `cartesian-error` commands what its damped inverse J# can reach, and nothing else: at a singularity the way out is
    not among it, and an acceleration limit would leave its few variables no room. Here the QP starts from a motion c
    that keeps the locked rows, and only corrects it for the limits:

    .. math::
        c = \varphi\,N_c\,\dot q_{prev} + (1 - \varphi)\,\bigl(\dot q_{pull} + J^\#(v - J_{free}\,\dot q_{pull})\bigr),
        \qquad n = c - J^\# J_{free}\,c

    .. math::
        \min_{\varepsilon, \beta, s}\ \tfrac12\,\varepsilon' W \varepsilon + \tfrac12\,w\,(1 - \beta)^2 + p\,s
        \quad\text{s.t.}\quad \dot q = J^\#(J_{free}\,c + \varepsilon) + \beta\,n

    within the bounds and the rate window of `joint-space-robust`, `excess` s included; damping, pull, governor and
    smoothing are those described there. Self-motion is still not used against limits, but a motion that the pull
    brought about is not lost either: n is what J# can't reach of c, and beta takes it back where limits ask for it.
    Zero motion, :math:`\varepsilon = -J_{free}\,c` and :math:`\beta = 0`, is feasible while `v_fixed` is zero.

    Where no limit is active, :math:`\dot q = c`, and there is nothing to iterate.

    Run-time parameters
    -------------------
    task_weight : shape (m_free,)
        W's diagonal, 1 unless told otherwise.
    qdd_prev, damping_threshold, damping_max, pull_gain, smoothing_time, smoothing_stretch, jerk_time, limit_time,
    excess_price, haste_price, governor_share
        As in `JointSpaceRobust`.
    """

    name: ClassVar[str] = "cartesian-error-robust"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        """State the problem of one control cycle."""
        eps = qp.variable("eps", tick.m_free)
        outside = qp.variable("outside share", 1)
        weight = tick.parameter("task_weight", 1.0, size=tick.m_free, lowest=0.0, positive=True)
        qp.minimize(eps, weight=weight, name="Cartesian error")
        onward = qp.variable("onward share", 1)
        qp.minimize(outside - 1, weight=OUTSIDE_WEIGHT, name="motion outside the inverse's range")
        qp.minimize(onward, weight=OUTSIDE_WEIGHT, name="going on as before")

        measured = damping(tick)
        inverse = matmul(tick.J_bar.T, measured.inverse)
        share, need = governor(tick, measured)
        v = tick.v * share - matmul(tick.J_free, tick.qd_fixed)
        tau = smoothing_time(tick, need)
        away = pull(tick, measured)
        wanted = away + matmul(inverse, v - matmul(tick.J_free, away))
        keep = kept_share(tick, tau)
        last = tick.fixed.project(tick.qd_prev.T).T if tick.m_fixed else tick.qd_prev
        calm = keep * last + (1 - keep) * wanted
        speed = matmul(tick.J_free, calm)
        rest = calm - matmul(inverse, speed)
        further = tick.fixed.project(continued(tick).T).T if tick.m_fixed else continued(tick)
        further = further - matmul(inverse, matmul(tick.J_free, further))
        qd = tick.qd_fixed + matmul(inverse, speed + eps) + outside * rest + onward * further

        window = rate_window(tick, tau, jerk=True)
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        limit_rate(qp, tick, qd, window)
        qp.command(qd)
        start = {"eps": -speed, "outside share": ca.SX(0), "onward share": ca.SX(0)}
        qp.feasible(**start, **needed_slacks(window, tick.qd_fixed))
