"""
Kinematics and dynamics of a chain as CasADi expressions, each computed when first asked for.

One walk from base to tip makes the joint axes and the offsets between them; pose, Jacobian and Jacobian's
rate are read off it in world axes, and the dynamics (module `dynamics`) works in the joints' own frames with
the same sines and cosines. Checked against pinocchio in the tests.

Source: Siciliano, Sciavicco, Villani, Oriolo, "Robotics: Modelling, Planning and Control", Springer 2009,
chapters 2, 3 and 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import casadi as ca

from . import algebra, dynamics
from .errors import RobotError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .algebra import Columns, Scalar, Vector
    from .chain import Chain


@dataclass(frozen=True, eq=False)
class _Walk:
    """
    What one pass over the chain leaves behind, in world axes.

    Parameters
    ----------
    axes
        z axis of each joint.
    offsets
        Vector from each joint's predecessor (the base for the first) to its own origin [m].
    tool_offset
        Vector from the last joint's origin to the tool centre point [m].
    tool_axes
        Axes of the tool's frame.
    frames
        Axes of each joint's own frame, after its motion.
    """

    axes: tuple[Vector, ...]
    offsets: tuple[Vector, ...]
    tool_offset: Vector
    tool_axes: Columns
    frames: tuple[Columns, ...]

    @cached_property
    def origins(self) -> tuple[Vector, ...]:
        """Origin of each joint's frame [m]."""
        origins = [self.offsets[0]]
        for offset in self.offsets[1:]:
            origins.append(algebra.add(origins[-1], offset))
        return tuple(origins)

    @cached_property
    def levers(self) -> tuple[Vector, ...]:
        """Vector from each joint's origin to the tool centre point [m]."""
        # Summed from the tip, so that the offset of the base enters the position only, not every lever.
        levers = [self.tool_offset]
        for offset in reversed(self.offsets[1:]):
            levers.append(algebra.add(levers[-1], offset))
        return tuple(reversed(levers))


@final
@dataclass(frozen=True, eq=False)
class SymbolicKinematics:
    """
    Expressions of one arm at symbolic joint positions and velocities.

    Parameters
    ----------
    chain
        The arm.
    has_inertia
        Whether the chain's masses are known.
    q
        Joint positions, `casadi.SX` of shape (nv, 1) [rad or m].
    qd
        Joint velocities, shape (nv, 1) [rad/s or m/s]; None if neither `jdot_qd` nor `bias_forces` is wanted.
    """

    chain: Chain
    has_inertia: bool
    q: ca.SX
    qd: ca.SX | None

    @cached_property
    def pose(self) -> ca.SX:
        """Pose of the tool's frame in the base frame, homogeneous, shape (4, 4) [m]."""
        walk = self._walk
        position = algebra.add(walk.offsets[0], walk.levers[0])
        columns = (*walk.tool_axes, position)
        rows = [ca.horzcat(*(column[row] for column in columns)) for row in range(3)]
        return ca.densify(ca.vertcat(*rows, ca.SX([[0.0, 0.0, 0.0, 1.0]])))

    @cached_property
    def jacobian(self) -> ca.SX:
        """Geometric Jacobian at the tool centre point, world axes, linear rows first, shape (6, nv)."""
        columns = []
        for segment, axis, lever in zip(self.chain.segments, self._walk.axes, self._walk.levers, strict=True):
            if segment.prismatic:
                columns.append((*axis, *algebra.ZERO))
            else:
                columns.append((*algebra.cross(axis, lever), *axis))
        return ca.densify(ca.SX(ca.horzcat(*(ca.vertcat(*column) for column in columns))))

    def point_on_link(self, link: int, position: Sequence[float]) -> ca.SX:
        """
        Position in the base frame of a point fixed to a link.

        Parameters
        ----------
        link
            Number of the joint that moves the link, counted from 1; 0 is the base.
        position
            Shape (3,): the point in the link's frame, as in the URDF (pinocchio's joint frame) [m].

        Returns
        -------
        Shape (3, 1) [m].

        Raises
        ------
        RobotError
            If there is no such link.
        """
        self._check_link(link)
        local = algebra.vector(position)
        if link == 0:
            return ca.SX(ca.vertcat(*local))
        turned = algebra.apply(algebra.columns(self.chain.link_rotations[link - 1]), local)
        inside = algebra.add(turned, algebra.vector(self.chain.link_translations[link - 1]))
        world = algebra.add(self._walk.origins[link - 1], algebra.apply(self._walk.frames[link - 1], inside))
        return ca.SX(ca.vertcat(*world))

    def point_jacobian(self, link: int, point: ca.SX) -> ca.SX:
        """
        Jacobian of the velocity of a point carried by a link.

        Parameters
        ----------
        link
            As for `point_on_link`.
        point
            Shape (3, 1): where the point is now, in the base frame [m]; it need not be a fixed one of the link.

        Returns
        -------
        Shape (3, nv), world axes; columns of joints beyond the link are zero by structure.

        Raises
        ------
        RobotError
            If there is no such link.
        """
        self._check_link(link)
        at = (point[0], point[1], point[2])
        jacobian = ca.SX(3, len(self.chain.segments))
        for i, segment in enumerate(self.chain.segments[:link]):
            axis = self._walk.axes[i]
            column = axis if segment.prismatic else algebra.cross(axis, algebra.subtract(at, self._walk.origins[i]))
            jacobian[:, i] = ca.vertcat(*column)
        return ca.sparsify(jacobian)

    @cached_property
    def jdot_qd(self) -> ca.SX:
        """
        Acceleration of the tool centre point at qdd = 0, shape (6, 1) [m/s^2, rad/s^2].

        World axes, linear rows first; the Jacobian's rate times `qd`.

        Raises
        ------
        RobotError
            If `qd` was not given.
        """
        velocities = self._velocities("jdot_qd")
        omega, alpha, linear = algebra.ZERO, algebra.ZERO, algebra.ZERO
        walk = self._walk
        for i, (segment, qd) in enumerate(zip(self.chain.segments, velocities, strict=True)):
            linear = algebra.add(linear, _swing(omega, alpha, walk.offsets[i]))
            motion = algebra.scale(walk.axes[i], qd)
            if segment.prismatic:
                coriolis = algebra.cross(omega, motion)
                linear = algebra.add(linear, algebra.add(coriolis, coriolis))
            else:
                alpha = algebra.add(alpha, algebra.cross(omega, motion))
                omega = algebra.add(omega, motion)
        linear = algebra.add(linear, _swing(omega, alpha, walk.tool_offset))
        return ca.densify(ca.SX(ca.vertcat(*linear, *alpha)))

    @cached_property
    def mass_matrix(self) -> ca.SX:
        """
        Joint-space inertia, shape (nv, nv) [kg m^2, kg m or kg].

        Raises
        ------
        RobotError
            If the robot's masses are not known.
        """
        self._need_inertia("mass_matrix")
        return dynamics.mass_matrix(self.chain, self._motions)

    @cached_property
    def bias_forces(self) -> ca.SX:
        """
        Joint forces that hold qdd at 0: Coriolis, centrifugal and gravity, shape (nv, 1) [Nm or N].

        Raises
        ------
        RobotError
            If the robot's masses are not known, or `qd` was not given.
        """
        self._need_inertia("bias_forces")
        return dynamics.bias_forces(self.chain, self._motions, self._velocities("bias_forces"))

    @cached_property
    def _motions(self) -> tuple[dynamics.Motion, ...]:
        motions = []
        for i, segment in enumerate(self.chain.segments):
            value = self.q[i]
            if segment.prismatic:
                motions.append(dynamics.Motion(cosine=1.0, sine=0.0, slide=value))
            else:
                motions.append(dynamics.Motion(cosine=ca.cos(value), sine=ca.sin(value), slide=0.0))
        return tuple(motions)

    @cached_property
    def _walk(self) -> _Walk:
        frame = algebra.IDENTITY
        axes, offsets, frames = [], [], []
        for segment, motion in zip(self.chain.segments, self._motions, strict=True):
            rotation = algebra.columns(segment.rotation)
            offset = algebra.apply(frame, algebra.vector(segment.translation))
            x, y, z = algebra.compose(frame, rotation)
            offsets.append(algebra.add(offset, algebra.scale(z, motion.slide)))
            axes.append(z)
            # Columns of [x y z] @ Rz: x and y mix, the joint's own axis stays.
            frame = (
                algebra.add(algebra.scale(x, motion.cosine), algebra.scale(y, motion.sine)),
                algebra.subtract(algebra.scale(y, motion.cosine), algebra.scale(x, motion.sine)),
                z,
            )
            frames.append(frame)
        return _Walk(
            axes=tuple(axes),
            offsets=tuple(offsets),
            tool_offset=algebra.apply(frame, algebra.vector(self.chain.tool_translation)),
            tool_axes=algebra.compose(frame, algebra.columns(self.chain.tool_rotation)),
            frames=tuple(frames),
        )

    def _check_link(self, link: int) -> None:
        if not 0 <= link <= len(self.chain.segments):
            raise RobotError(f"link: expected 0 (the base) to {len(self.chain.segments)}, got {link}")

    def _velocities(self, wanted: str) -> list[Scalar]:
        if self.qd is None:
            raise RobotError(f"qd: expected joint velocities for {wanted}, got none; call robot.symbolic(q, qd)")
        return [self.qd[i] for i in range(len(self.chain.segments))]

    def _need_inertia(self, wanted: str) -> None:
        if not self.has_inertia:
            raise RobotError(no_inertia_message(wanted))


def check_symbol(name: str, value: Any, nv: int) -> None:
    """Raise a RobotError unless `value` is a `casadi.SX` of shape (nv, 1)."""
    if not isinstance(value, ca.SX):
        raise RobotError(f"{name}: expected a casadi.SX of shape ({nv}, 1), got {type(value).__name__}")
    if value.shape != (nv, 1):
        raise RobotError(f"{name}: expected shape ({nv}, 1), got {value.shape}")


def no_inertia_message(wanted: str) -> str:
    """Return the sentence for an arm whose masses are not known; one wording for numbers and for symbols."""
    return (
        f"{wanted}: expected a robot with link inertias, got one without; "
        "give every moving link an <inertial> in its URDF, or use a formulation at velocity level"
    )


def _swing(omega: Vector, alpha: Vector, lever: Vector) -> Vector:
    """Return the acceleration that turning with omega and alpha gives a point at `lever`."""
    return algebra.add(algebra.cross(alpha, lever), algebra.cross(omega, algebra.cross(omega, lever)))
