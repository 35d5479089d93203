"""
Symbolic inertia and bias forces, in the joints' own frames.

In those frames every joint axis is (0, 0, 1), a link's inertia is constant, and passing from one frame to the
next is a turn about z followed by a constant placement, so that few products are left.

Sources: composite rigid bodies and recursive Newton-Euler as in Featherstone, "Rigid Body Dynamics
Algorithms", Springer 2008, chapters 5 and 6; the matrix [alpha]x + [omega]x[omega]x, which serves both the
force on a link and the acceleration of the next, follows Balafoutis and Patel, "Dynamic Analysis of Robot
Manipulators", Kluwer 1991.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from .algebra import (
    ZERO,
    Columns,
    Scalar,
    Vector,
    add,
    apply,
    apply_transposed,
    columns,
    cross,
    dot,
    minus,
    plus,
    scale,
    times,
    turn_z,
    vector,
)

if TYPE_CHECKING:
    from .chain import Chain, Segment


@dataclass(frozen=True)
class Motion:
    """
    What one joint does to its frame.

    Parameters
    ----------
    cosine, sine
        Of the joint's angle; 1 and 0 for a prismatic joint.
    slide
        Displacement along the joint's z axis [m]; 0 for a revolute joint.
    """

    cosine: Scalar
    sine: Scalar
    slide: Scalar


@dataclass(frozen=True)
class _Passage:
    """From one joint's moved frame to that of its predecessor."""

    segment: Segment
    motion: Motion

    @property
    def rotation(self) -> Columns:
        return columns(self.segment.rotation)

    @property
    def origin(self) -> Vector:
        """Return the moved frame's origin in the predecessor's frame [m]."""
        return add(vector(self.segment.translation), scale(self.rotation[2], self.motion.slide))

    def outwards(self, a: Vector) -> Vector:
        """Return the components in the moved frame of a vector given in the predecessor's."""
        return turn_z(self.motion.cosine, times(-1.0, self.motion.sine), apply_transposed(self.rotation, a))

    def inwards(self, a: Vector) -> Vector:
        """Return the components in the predecessor's frame of a vector given in the moved one."""
        return apply(self.rotation, turn_z(self.motion.cosine, self.motion.sine, a))


@dataclass(frozen=True)
class _Body:
    """Mass, first moment and inertia about the frame's origin of one link or of several joined ones."""

    mass: float
    first_moment: Vector
    inertia: Columns

    def joined(self, other: _Body) -> _Body:
        ours, theirs = self.inertia, other.inertia
        return _Body(
            self.mass + other.mass,
            add(self.first_moment, other.first_moment),
            (add(ours[0], theirs[0]), add(ours[1], theirs[1]), add(ours[2], theirs[2])),
        )


def _body(segment: Segment) -> _Body:
    return _Body(segment.mass, vector(segment.first_moment), columns(segment.inertia))


def _symmetric(xx: Scalar, yy: Scalar, zz: Scalar, xy: Scalar, xz: Scalar, yz: Scalar) -> Columns:
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


def _turned(inertia: Columns, motion: Motion) -> Columns:
    """Return Rz @ inertia @ Rz.T from the six distinct entries."""
    c, s = motion.cosine, motion.sine
    if isinstance(s, float):  # a prismatic joint
        return inertia
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    # With w = c (xx - yy) - 2 s xy the turned block needs six products instead of twelve.
    w = minus(times(c, minus(xx, yy)), times(s, plus(xy, xy)))
    new_xx = plus(yy, times(c, w))
    new_xy = plus(xy, times(s, w))
    new_yy = minus(xx, times(c, w))
    return _symmetric(new_xx, new_yy, zz, new_xy, minus(times(c, xz), times(s, yz)), plus(times(s, xz), times(c, yz)))


def _rotated(inertia: Columns, rotation: Columns) -> Columns:
    """Return rotation @ inertia @ rotation.T for a constant rotation."""
    half = tuple(apply(rotation, column) for column in inertia)
    rows = tuple(tuple(column[row] for column in rotation) for row in range(3))
    entry = [[dot(tuple(half[k][i] for k in range(3)), rows[j]) for j in range(3)] for i in range(3)]
    return _symmetric(entry[0][0], entry[1][1], entry[2][2], entry[0][1], entry[0][2], entry[1][2])


def _carried_inwards(body: _Body, passage: _Passage) -> _Body:
    """Return the body as the predecessor's frame sees it."""
    moment = passage.inwards(body.first_moment)
    inertia = _rotated(_turned(body.inertia, passage.motion), passage.rotation)
    p, m = passage.origin, body.mass
    # Parallel axes: adds 2 p.h 1 - p h' - h p' + m (p.p 1 - p p'), with k = h + m p / 2 taken twice.
    k = add(moment, scale(p, 0.5 * m))
    px, py, pz = (times(2.0, a) for a in p)
    xx, yy, zz = times(px, k[0]), times(py, k[1]), times(pz, k[2])
    shift = _symmetric(
        plus(yy, zz),
        plus(xx, zz),
        plus(xx, yy),
        _mixed(p[0], k[0], p[1], k[1]),
        _mixed(p[0], k[0], p[2], k[2]),
        _mixed(p[1], k[1], p[2], k[2]),
    )
    moved = (add(inertia[0], shift[0]), add(inertia[1], shift[1]), add(inertia[2], shift[2]))
    return _Body(m, add(moment, scale(p, m)), moved)


def _mixed(pa: Scalar, ka: Scalar, pb: Scalar, kb: Scalar) -> Scalar:
    return times(-1.0, plus(times(pa, kb), times(pb, ka)))


def mass_matrix(chain: Chain, motions: tuple[Motion, ...]) -> ca.SX:
    """
    Return the joint-space inertia by composite rigid bodies.

    Parameters
    ----------
    chain
        The arm.
    motions
        One for each joint.

    Returns
    -------
    `casadi.SX`, symmetric, shape (nv, nv) [kg m^2, kg m or kg].
    """
    count = len(chain.segments)
    passages = [_Passage(segment, motion) for segment, motion in zip(chain.segments, motions, strict=True)]
    matrix = ca.SX.zeros(count, count)
    body = _body(chain.segments[-1])
    for i in range(count - 1, -1, -1):
        hx, hy, _ = body.first_moment
        if chain.segments[i].prismatic:
            force: Vector = (0.0, 0.0, body.mass)
            torque: Vector = (hy, times(-1.0, hx), 0.0)
        else:
            force = (times(-1.0, hy), hx, 0.0)
            torque = body.inertia[2]
        matrix[i, i] = force[2] if chain.segments[i].prismatic else torque[2]
        for j in range(i - 1, -1, -1):
            inner = passages[j + 1]
            force = inner.inwards(force)
            torque = add(inner.inwards(torque), cross(inner.origin, force))
            matrix[i, j] = matrix[j, i] = force[2] if chain.segments[j].prismatic else torque[2]
        if i > 0:
            body = _body(chain.segments[i - 1]).joined(_carried_inwards(body, passages[i]))
    return matrix


def bias_forces(chain: Chain, motions: tuple[Motion, ...], velocities: list[Scalar]) -> ca.SX:
    """
    Return the joint forces at qdd = 0 by recursive Newton-Euler.

    Parameters
    ----------
    chain
        The arm.
    motions
        One for each joint.
    velocities
        Joint velocities [rad/s or m/s].

    Returns
    -------
    `casadi.SX`, shape (nv, 1) [Nm or N].
    """
    passages = [_Passage(segment, motion) for segment, motion in zip(chain.segments, motions, strict=True)]
    omega, alpha = ZERO, ZERO
    # An upward acceleration of the base stands in for gravity, so that no link needs a weight of its own.
    linear = scale(vector(chain.gravity), -1.0)
    swing: Columns = (ZERO, ZERO, ZERO)
    forces, torques = [], []
    for passage, qd in zip(passages, velocities, strict=True):
        linear = passage.outwards(add(linear, apply(swing, passage.origin)))
        omega, alpha = passage.outwards(omega), passage.outwards(alpha)
        spin: Vector = (0.0, 0.0, qd)
        if passage.segment.prismatic:
            coriolis = cross(omega, spin)
            linear = add(linear, add(coriolis, coriolis))
        else:
            alpha = add(alpha, cross(omega, spin))
            omega = add(omega, spin)
        swing = _swing_matrix(omega, alpha)
        body = _body(passage.segment)
        forces.append(add(scale(linear, body.mass), apply(swing, body.first_moment)))
        torques.append(add(_swing_torque(swing, passage.segment), cross(body.first_moment, linear)))
    result: list[Scalar] = []
    force, torque = ZERO, ZERO
    for i in range(len(passages) - 1, -1, -1):
        force, torque = add(force, forces[i]), add(torque, torques[i])
        result.append(force[2] if passages[i].segment.prismatic else torque[2])
        force = passages[i].inwards(force)
        torque = add(passages[i].inwards(torque), cross(passages[i].origin, force))
    return ca.densify(ca.SX(ca.vertcat(*reversed(result))))


def _swing_matrix(omega: Vector, alpha: Vector) -> Columns:
    """Return the columns of [alpha]x + [omega]x [omega]x."""
    x, y, z = omega
    xx, yy, zz = times(x, x), times(y, y), times(z, z)
    xy, xz, yz = times(x, y), times(x, z), times(y, z)
    ax, ay, az = alpha
    return (
        (times(-1.0, plus(yy, zz)), plus(xy, az), minus(xz, ay)),
        (minus(xy, az), times(-1.0, plus(xx, zz)), plus(yz, ax)),
        (plus(xz, ay), minus(yz, ax), times(-1.0, plus(xx, yy))),
    )


def _swing_torque(swing: Columns, segment: Segment) -> Vector:
    """Return I alpha + omega x I omega: the antisymmetric part of swing @ S, S the second moments of mass."""
    second = 0.5 * np.trace(segment.inertia) * np.eye(3) - segment.inertia
    product = tuple(apply(swing, column) for column in columns(second))
    return (
        minus(product[1][2], product[2][1]),
        minus(product[2][0], product[0][2]),
        minus(product[0][1], product[1][0]),
    )
