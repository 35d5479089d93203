"""
A serial chain in the form in which its equations are shortest.

Every joint turns about, or slides along, the z axis of its own frame, and every frame's origin is moved along
that axis so that as many constant offsets as possible vanish. Both are free choices - a point may slide along
a joint's axis, and a constant rotation may pass from one side of the joint to the other - but they decide how
many products survive in the generated code: the LBR keeps four offsets (0.36, 0.42, 0.40, 0.126 m), however
its URDF splits them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from .checks import FloatArray, read_only

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Rounding of cos(pi/2) and of products of such; nothing a person writes as 1.5708 comes near it.
SNAP = 1e-15


@dataclass(frozen=True, eq=False)
class Segment:
    """
    One joint and the link that it moves.

    Parameters
    ----------
    prismatic
        Whether the joint slides along its z axis; otherwise it turns about it.
    rotation
        Shape (3, 3): axes of the joint's frame at q = 0, in the previous joint's frame.
    translation
        Shape (3,): its origin in the previous joint's frame at q = 0 [m].
    mass
        Mass of the link [kg].
    first_moment
        Shape (3,): mass times centre of mass, in the joint's frame [kg m].
    inertia
        Shape (3, 3): rotational inertia about the joint frame's origin, in its axes [kg m^2].
    """

    prismatic: bool
    rotation: FloatArray
    translation: FloatArray
    mass: float
    first_moment: FloatArray
    inertia: FloatArray


@dataclass(frozen=True, eq=False)
class Chain:
    """
    The segments from base to tip, and the tool centre point in the last joint's frame.

    Parameters
    ----------
    segments
        One for each joint, base first.
    tool_rotation
        Shape (3, 3): axes of the tool's frame in the last joint's frame.
    tool_translation
        Shape (3,): tool centre point in the last joint's frame [m].
    gravity
        Shape (3,): acceleration of gravity in the base frame [m/s^2].
    link_rotations, link_translations
        Per joint, shapes (3, 3) and (3,): pinocchio's joint frame (the URDF's link frame) in ours [m].
    """

    segments: tuple[Segment, ...]
    tool_rotation: FloatArray
    tool_translation: FloatArray
    gravity: FloatArray
    link_rotations: tuple[FloatArray, ...]
    link_translations: tuple[FloatArray, ...]


def snap(value: FloatArray) -> FloatArray:
    """Return a read-only copy with entries within `SNAP` of 0, 1 and -1 set to exactly that."""
    result = np.array(value, dtype=np.float64)
    for target in (0.0, 1.0, -1.0):
        result[np.abs(result - target) < SNAP] = target
    return read_only(result)


def joint_axis(joint: Any) -> tuple[bool, FloatArray]:
    """
    Return whether a one-axis pinocchio joint is prismatic, and its unit axis in its own frame, shape (3,).

    The axis is read off the motion subspace because that exists for every joint type, aligned or not.
    """
    data = joint.createData()
    # pinocchio's calc reads at the joint's place in the whole model's vector.
    q = np.zeros(joint.idx_q + joint.nq)
    q[joint.idx_q] = 1.0
    joint.calc(data, q)
    subspace = np.asarray(data.S, dtype=np.float64).reshape(6)
    prismatic = bool(np.any(subspace[:3] != 0.0))
    return prismatic, subspace[:3] if prismatic else subspace[3:]


@dataclass(frozen=True, eq=False)
class JointPlaces:
    """
    Where the joints' entries are in pinocchio's configuration vector.

    Parameters
    ----------
    first
        Shape (nv,): index of each joint's first entry.
    single
        Joints with one entry, their position.
    continuous
        Joints with two, the cosine and sine of their angle.
    """

    first: NDArray[np.intp]
    single: NDArray[np.intp]
    continuous: NDArray[np.intp]


def joint_places(model: Any) -> JointPlaces:
    """Read the places once: walking over pinocchio's joints from Python costs more than the kinematics."""
    joints = list(model.joints)[1:]
    two = np.array([joint.nq == 2 for joint in joints])
    first = np.array([joint.idx_q for joint in joints])
    return JointPlaces(first=first, single=np.flatnonzero(~two), continuous=np.flatnonzero(two))


def _rotation_from_z(axis: FloatArray) -> FloatArray:
    """Return a rotation that takes z to the unit vector `axis`; for a coordinate axis, a permutation."""
    # The axis's least entry gives the best-conditioned first column, and for coordinate axes an exact one.
    helper = np.zeros(3)
    helper[int(np.argmin(np.abs(axis)))] = 1.0
    x = helper - axis * (axis @ helper)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def _snapped(placement: Any) -> Any:
    return pin.SE3(np.array(snap(placement.rotation)), np.array(snap(placement.translation)))


def build_chain(model: Any, frame_id: int) -> Chain:
    """
    Read a chain from a pinocchio model whose joints are one serial chain.

    Parameters
    ----------
    model
        A `pin.Model`; joint i moves joint i + 1, and each has one axis.
    frame_id
        Index of the tool's frame in the model; it must be carried by the last joint.

    Returns
    -------
    The chain in its shortest form; exact up to rounding.
    """
    count = model.njoints - 1
    axes = [joint_axis(model.joints[i]) for i in range(1, count + 1)]
    # changes[i] is our frame of joint i in pinocchio's; the base's and the tool's frames stay as they are.
    changes = [pin.SE3.Identity()]
    changes += [pin.SE3(snap(_rotation_from_z(axis)).copy(), np.zeros(3)) for _, axis in axes]
    changes.append(pin.SE3.Identity())
    placements = [_snapped(model.jointPlacements[i]) for i in range(1, count + 1)]
    placements.append(_snapped(model.frames[frame_id].placement))
    links = [
        _snapped(before.actInv(placement * after))
        for before, placement, after in zip(changes, placements, changes[1:], strict=False)
    ]
    # From the tip inwards, so that an offset can slide past several joints in one pass.
    for i in range(count, 0, -1):
        offset = links[i].translation.copy()
        if not axes[i - 1][0]:
            offset[:2] = 0.0  # a revolute joint lets only its own axis through
        slide = pin.SE3(np.eye(3), offset)
        links[i] = _snapped(slide.actInv(links[i]))
        links[i - 1] = _snapped(links[i - 1] * slide)
        changes[i] = changes[i] * slide
    segments = []
    for i in range(count):
        inertia = changes[i + 1].actInv(model.inertias[i + 1])
        # pinocchio's 6x6 matrix holds mass, first moment and the inertia about the frame's origin in its
        # blocks.
        lower = inertia.matrix()[3:, 3:]
        segments.append(
            Segment(
                prismatic=axes[i][0],
                rotation=snap(links[i].rotation),
                translation=snap(links[i].translation),
                mass=float(inertia.mass),
                first_moment=snap(inertia.mass * inertia.lever),
                inertia=snap(lower),
            )
        )
    link_frames = [change.inverse() for change in changes[1 : count + 1]]
    return Chain(
        segments=tuple(segments),
        tool_rotation=snap(links[count].rotation),
        tool_translation=snap(links[count].translation),
        gravity=snap(model.gravity.linear),
        link_rotations=tuple(snap(frame.rotation) for frame in link_frames),
        link_translations=tuple(snap(frame.translation) for frame in link_frames),
    )
