"""Closest points of segments as CasADi expressions that are finite everywhere.

Source of the case analysis: Ericson, "Real-Time Collision Detection", Morgan Kaufmann 2005, section 5.1.9. Two things
differ. What the textbook subtracts from nearly equal products is taken from cross products here, which keeps all digits
however parallel the segments are. And parallel segments, whose closest points are not unique, get the middle of where
they face each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ..algebra import dot

# Segments shorter than this are points [m].
_POINT = 1e-9
# Sine of the angle below which segments count as parallel: the distance is then off by at most this times their length.
_PARALLEL = 1e-12


@dataclass(frozen=True)
class Segment:
    """A segment in space, or a point.

    Attributes
    ----------
    start : ca.SX, shape (3, 1)
        [m].
    along : ca.SX, shape (3, 1), or None
        From start to end [m]; None for a point.
    """

    start: ca.SX
    along: ca.SX | None

    def nearest(self, point: ca.SX) -> ca.SX:
        """Give the segment's point that is nearest to another, shape (3, 1)."""
        return self.start if self.along is None else self.start + _share_of(self.along, point - self.start) * self.along


def closest_points(first: Segment, second: Segment) -> tuple[ca.SX, ca.SX]:
    """Give a point of each segment, shape (3, 1), such that no two others are closer [m].

    Where segments cross, the points coincide; where they are parallel, they lie in the middle of the stretch that faces
    the other. There, and where the closest point passes an end, the points move continuously or jump, but the distance
    is continuous, and never NaN.
    """
    if first.along is not None and second.along is not None:
        return _of_two_segments(first.start, first.along, second.start, second.along)
    return first.nearest(second.start), second.nearest(first.start)


def _of_two_segments(p: ca.SX, u: ca.SX, q: ca.SX, w: ca.SX) -> tuple[ca.SX, ca.SX]:
    between = q - p
    normal = ca.cross(u, w)
    squared = dot(normal, normal)
    lengths = dot(u, u), dot(w, w)
    # A segment that counts as a point is parallel to everything: the rest then asks for its projection.
    have_length = ca.logic_and(lengths[0] > _POINT**2, lengths[1] > _POINT**2)
    crossing = ca.logic_and(have_length, squared > _PARALLEL**2 * lengths[0] * lengths[1])
    # The lines' closest points, or the middle of the overlap of two parallel ones.
    on_lines = dot(ca.cross(between, w), normal) / ca.if_else(crossing, squared, 1)
    ends = _share_of(u, between, clamp=False), _share_of(u, between + w, clamp=False)
    low, high = ca.fmax(ca.fmin(*ends), 0), ca.fmin(ca.fmax(*ends), 1)
    s = _clamp(ca.if_else(crossing, on_lines, (low + high) / 2))
    # Where the partner lies beyond an end of the second segment, that end decides, and the first segment follows.
    t = _share_of(w, p + s * u - q, clamp=False)
    beyond_start, beyond_end = t < 0, t > 1
    s = ca.if_else(beyond_start, _clamp(ends[0]), ca.if_else(beyond_end, _clamp(ends[1]), s))
    return p + s * u, q + _clamp(t) * w


def _share_of(along: ca.SX, offset: ca.SX, *, clamp: bool = True) -> ca.SX:
    """Share of `along` at which it passes closest to `offset` from its start; zero for a segment without length."""
    squared = dot(along, along)
    exists = squared > _POINT**2
    share = ca.if_else(exists, dot(along, offset) / ca.if_else(exists, squared, 1), 0)
    return _clamp(share) if clamp else share


def _clamp(share: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(share, 0), 1)


def direction(first: ca.SX, second: ca.SX, first_along: ca.SX | None, second_along: ca.SX | None) -> ca.SX:
    """Unit vector from the second of two closest points to the first, shape (3, 1), for the rate of their distance.

    Where the points coincide there is no such direction; the common normal of the segments stands in, and where these
    are parallel or points, the vertical: a row that blocks half of all motions there, rather than none.
    """
    apart = first - second
    squared = dot(apart, apart)
    exists = squared > _POINT**2
    substitute = ca.SX([0.0, 0.0, 1.0])
    if first_along is not None and second_along is not None:
        normal = ca.cross(first_along, second_along)
        size = dot(normal, normal)
        crossing = size > _PARALLEL**2 * dot(first_along, first_along) * dot(second_along, second_along)
        scale = ca.if_else(crossing, 1 / ca.sqrt(ca.if_else(crossing, size, 1)), 0)
        substitute = ca.if_else(crossing, normal * scale, substitute)
    scale = ca.if_else(exists, 1 / ca.sqrt(ca.if_else(exists, squared, 1)), 0)
    return ca.if_else(exists, apart * scale, substitute)
