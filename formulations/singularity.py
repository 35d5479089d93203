"""What keeps a formulation calm near singularities: damping, a pull out of them, a governor of the hand's speed.

Sources: damping after Nakamura and Hanafusa (1986); the derivative of a singular value, u' (dJ) w with its two singular
vectors, after Stewart and Sun, "Matrix Perturbation Theory" (1990), IV.2; the rest is this project's own, measured in
docs/singularities.md. The thesis leaves the singularities of `joint-space` open (4.5.4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import casadi as ca

from .algebra import dot, inverse_of_positive, matmul
from .inverse import squared_singular_value_estimate

if TYPE_CHECKING:
    from .tick import Tick

# Wider and stronger than what `tick.inverse` has as defaults: here the pull makes up for what damping takes. With 0.1
# and 0.08 the way through a singularity is so narrow that at 0.5 m/s accelerations change sign within a tick.
DAMPING_THRESHOLD: Final = 0.2
DAMPING_MAX: Final = 0.12
PULL_GAIN: Final = 2.0
# Below this share of the threshold a singular direction counts as lost, and the side to leave it by is chosen.
LOST: Final = 0.02
# How far ahead the side is looked up [s]: the velocity of a few ticks outweighs an encoder's noise.
AHEAD: Final = 0.1
# Less than this to one side is no side [m or rad]: along self-motions that are singular all the way rounding would
# choose, and differently from one tick to the next.
UNDECIDED: Final = 1e-9
# How far ahead the governor looks at the arm's own motion [s]: as long as the jerk limit takes to build up braking.
BRAKING_AHEAD: Final = 0.06
# |self-motion gradient| below which there is no way out worth going [1].
FLAT: Final = 1e-2


@dataclass(frozen=True)
class Damping:
    """How weak the guided rows are at a state, and the damping against it.

    Attributes
    ----------
    gram : ca.SX, shape (m_free, m_free)
        J_bar J_bar'.
    sigma2 : ca.SX, scalar
        Lower estimate of the squared smallest singular value.
    threshold : ca.SX, scalar
        sigma_0, below which damping sets in.
    weakness : ca.SX, scalar
        1 - s^2 / sigma_0^2: one at a singularity, zero from the threshold up.
    lambda2 : ca.SX, scalar
        Squared damping, (lambda_max weakness)^2.
    """

    gram: ca.SX
    sigma2: ca.SX
    threshold: ca.SX
    weakness: ca.SX
    lambda2: ca.SX

    @property
    def inverse(self) -> ca.SX:
        """(J_bar J_bar' + lambda^2 I)^-1, shape (m_free, m_free)."""
        return inverse_of_positive(self.gram + self.lambda2 * ca.SX.eye(self.gram.size1()))


def damping(tick: Tick) -> Damping:
    """Measure the guided rows; run-time parameters `damping_threshold` and `damping_max` as in `robust_inverse`."""
    threshold = tick.parameter("damping_threshold", DAMPING_THRESHOLD, lowest=0.0, positive=True, unit="m or rad")
    damping_max = tick.parameter("damping_max", DAMPING_MAX, lowest=0.0, positive=True, unit="m or rad")
    gram = matmul(tick.J_bar, tick.J_bar.T)
    sigma2 = squared_singular_value_estimate(gram)
    weakness = ca.fmax(1 - sigma2 / threshold**2, 0)
    return Damping(gram, sigma2, threshold, weakness, (damping_max * weakness) ** 2)


def pull(tick: Tick, measured: Damping) -> ca.SX:
    r"""Joint velocity that leads away from a singularity the hand pulls against, shape (nv, 1) [rad/s or m/s].

    Up the gradient of the smallest singular value, :math:`\nabla\sigma = \nabla_q (u' \bar J w)` with the singular
    vectors held, projected on the null space of the locked rows; as fast as the hand's velocity along u times
    `pull_gain` and the weakness, so that nothing moves while nothing is asked.

    - u is what the Gram matrix's regularised inverse leaves of v: the singular direction, weighed by the hand's pull.
    - sigma has no gradient at a singularity itself, a kink of |sigma|: both ways out of a stretched elbow are equally
      good, and w is any vector. There w is made up from a fixed vector, turned to the side on which the arm is already.
    - The null space moves with q, too. With :math:`N_c w = w` its derivative is that of the locked rows alone:
      :math:`\nabla (u' J_{free} N_c w) = \nabla (u' J_{free} - z' J_{fixed})\,w` where z' J_fixed is u' J_free in the
      span of the locked rows. One reverse sweep over the Jacobian, and no derivative of a factorisation.
    """
    gain = tick.parameter("pull_gain", PULL_GAIN, lowest=0.0, unit="1/m")
    nv = tick.nv
    lost2 = (LOST * measured.threshold) ** 2
    regular = inverse_of_positive(measured.gram + 0.25 * lost2 * ca.SX.eye(tick.m_free))
    along = (measured.sigma2 + 0.25 * lost2) * matmul(regular, tick.v)
    strength = ca.sqrt(dot(along, along) + 1e-16)
    u = along / strength
    rows = ca.SX(6, 1)
    rows[list(tick.mode.free_rows)] = u
    if tick.m_fixed:
        rows[list(tick.mode.fixed_rows)] = -tick.fixed.solve_transposed(matmul(tick.J_free.T, u))
    left, right = ca.SX.sym("left", 6), ca.SX.sym("right", nv)
    held = matmul(tick.J.T, left)
    # The right singular vector times sigma, and what takes its place where that vanishes: no two entries alike, so that
    # no symmetry of the arm makes it blind.
    w = matmul(tick.J_bar.T, u)
    golden = 0.5 * (5.0**0.5 - 1.0)
    side = ca.SX([0.5 + (golden * (i + 1)) % 1.0 for i in range(nv)])
    if tick.m_fixed:
        side = tick.fixed.project(side.T).T
    side = side / ca.sqrt(dot(side, side) + 1e-20)
    # As it will be a moment ahead: a choice once made is kept whatever the noise on q.
    turn = ca.substitute(ca.jtimes(held, tick.q, tick.qd_prev), left, ca.densify(rows))
    turned = dot(w + AHEAD * turn, side)
    w = w + ca.sqrt(lost2) * ca.if_else(turned < -UNDECIDED, -1, 1) * side
    w = w / ca.sqrt(dot(w, w) + 1e-20)
    gradient = ca.gradient(dot(held, right), tick.q)
    gradient = ca.substitute(gradient, ca.vertcat(left, right), ca.densify(ca.vertcat(rows, w)))
    if tick.m_fixed:
        gradient = tick.fixed.project(gradient.T).T
    return gain * measured.weakness * strength * gradient / ca.sqrt(dot(gradient, gradient) + FLAT**2)


def governor(tick: Tick, measured: Damping) -> tuple[ca.SX, ca.SX]:
    r"""Share of the hand's velocity at which the rows leave the joints enough acceleration, and what they then need.

    Keeping a twist J qd while the arm moves takes the accelerations :math:`-J^\# \dot J \dot q`, whatever the QP
    wishes, and they grow without bound where rows become dependent. They go with the square of the speed: it is
    reduced until those for the locked rows alone take no more than the share `governor_share` of `qdd_max`, and those
    for all rows no more than all of it, judged at the joint velocity that the hand asks for, :math:`J^\# v`.

    The arm's own velocity is another one where the hand's turns quickly or damping fades, and an arm that is too fast
    when the rows become dependent can't brake in time. So the locked rows' accelerations are also judged where the last
    command leads within `BRAKING_AHEAD`, at its velocity; beyond their share the hand's speed falls by the power 1.5 of
    it, which the arm follows with a lag.

    Returns
    -------
    share : ca.SX, scalar
        0 to 1.
    needed : ca.SX, scalar
        Largest acceleration for all rows at that share of the speed, as a share of `qdd_max`, 0 to 1.
    """
    allowed = tick.parameter("governor_share", 0.3, lowest=0.0, positive=True)
    wanted = matmul(tick.J_bar.T, matmul(measured.inverse, tick.v))
    x = ca.SX.sym("x", tick.nv)
    rows = [*tick.mode.free_rows, *tick.mode.fixed_rows]
    rate = ca.jtimes(matmul(tick.J[rows, :], x), tick.q, x)
    moving, rate = rate, ca.substitute(rate, x, ca.densify(wanted))
    guided, locked, share2 = rate[: tick.m_free], ca.SX(tick.nv, 1), ca.SX(1)
    if tick.m_fixed:
        locked = tick.fixed.solve(rate[tick.m_free :])
        guided = guided - matmul(tick.J_free, locked)
        share2 = ca.fmin(1, allowed / (largest(ca.fabs(locked) / tick.qdd_max) + 1e-9))
        soon = largest(ca.fabs(tick.fixed.solve(moving[tick.m_free :])) / tick.qdd_max)
        there = ca.vertcat(tick.q + BRAKING_AHEAD * tick.qd_prev, tick.qd_prev)
        soon = ca.substitute(soon, ca.vertcat(tick.q, x), there)
        share2 = ca.fmin(share2, (allowed / (soon + 1e-9)) ** 3)
    whole = locked + matmul(tick.J_bar.T, matmul(measured.inverse, guided))
    needed = largest(ca.fabs(whole) / tick.qdd_max)
    share2 = ca.fmin(share2, 1 / (needed + 1e-9))
    return ca.sqrt(share2), needed * share2


def largest(values: ca.SX) -> ca.SX:
    """Largest entry of a column."""
    left = [values[i] for i in range(values.size1())]
    while len(left) > 1:
        left = [ca.fmax(*left[i : i + 2]) if i + 1 < len(left) else left[i] for i in range(0, len(left), 2)]
    return left[0]
