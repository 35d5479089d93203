"""An arm: one serial chain with its limits, and its kinematics and dynamics as numbers and as expressions."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np
import pinocchio as pin

from .chain import Chain, JointPlaces, build_chain, joint_places
from .checks import FloatArray, finite_vector, read_only
from .errors import RobotError
from .symbolic import SymbolicKinematics, check_symbol, no_inertia_message

if TYPE_CHECKING:
    import casadi as ca
    from numpy.typing import ArrayLike


@final
@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """
    One serial chain from a fixed base to a tool, with its limits.

    `q` has one entry for each joint everywhere: rad for a revolute or continuous joint, m for a prismatic
    one. The base frame is the world frame, with z up. The arrays cannot be written to. Instances can be
    pickled and copied, and, as every thread has its own buffers, shared between threads.

    Parameters
    ----------
    name
        Name of the robot.
    tip
        Name of the frame at the tool centre point.
    joint_names
        One for each joint, base first.
    q_min, q_max
        Shape (nv,): position limits [rad or m]; -inf and inf for a continuous joint.
    qd_max
        Shape (nv,): velocity limits, the same in both directions [rad/s or m/s].
    qdd_max
        Shape (nv,): acceleration limits [rad/s^2 or m/s^2].
    tau_max
        Shape (nv,): limits of the joint force [Nm or N]; inf where none is known.
    has_inertia
        Whether masses are known, so that `mass_matrix` and `bias_forces` exist.
    model
        The `pin.Model` of exactly this chain, for collision checks and the like; not to be changed.
    """

    name: str
    tip: str
    joint_names: tuple[str, ...]
    q_min: FloatArray
    q_max: FloatArray
    qd_max: FloatArray
    qdd_max: FloatArray
    tau_max: FloatArray
    has_inertia: bool
    model: Any

    def __post_init__(self) -> None:
        for field in ("q_min", "q_max", "qd_max", "qdd_max", "tau_max"):
            object.__setattr__(self, field, read_only(getattr(self, field)))

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, nv={self.nv}, tip={self.tip!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        # Through the constructor, because NumPy's pickles forget that an array is read-only.
        fields = self.__dataclass_fields__
        return Robot, tuple(getattr(self, field) for field in fields)

    @property
    def nv(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    def to_pinocchio(self, q: ArrayLike) -> FloatArray:
        """
        Return `q` as pinocchio's configuration of `model`: a continuous joint as cosine and sine.

        Parameters
        ----------
        q
            Shape (nv,): joint positions [rad or m].

        Returns
        -------
        Shape (model.nq,).

        Raises
        ------
        ValueError
            If `q` has the wrong shape or is not finite.
        """
        values, places = finite_vector("q", q, self.nv), self._places
        if not len(places.continuous):
            return values
        result = np.empty(self.model.nq)
        result[places.first[places.single]] = values[places.single]
        result[places.first[places.continuous]] = np.cos(values[places.continuous])
        result[places.first[places.continuous] + 1] = np.sin(values[places.continuous])
        return result

    def pose(self, q: ArrayLike) -> FloatArray:
        """
        Return the pose of the tool's frame in the base frame.

        Parameters
        ----------
        q
            Shape (nv,): joint positions [rad or m].

        Returns
        -------
        Shape (4, 4): homogeneous, translation in m.

        Raises
        ------
        ValueError
            If `q` has the wrong shape or is not finite.
        """
        data = self._data
        pin.forwardKinematics(self.model, data, self.to_pinocchio(q))
        return np.array(pin.updateFramePlacement(self.model, data, self._frame).homogeneous, dtype=np.float64)

    def jacobian(self, q: ArrayLike) -> FloatArray:
        """
        Return the geometric Jacobian at the tool centre point.

        Parameters
        ----------
        q
            Shape (nv,): joint positions [rad or m].

        Returns
        -------
        Shape (6, nv): linear rows first, world axes.

        Raises
        ------
        ValueError
            If `q` has the wrong shape or is not finite.
        """
        data = self._data
        matrix = pin.computeFrameJacobian(
            self.model, data, self.to_pinocchio(q), self._frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        # A matrix of one column comes as a vector.
        return np.array(matrix, dtype=np.float64).reshape(6, self.nv)

    def jdot_qd(self, q: ArrayLike, qd: ArrayLike) -> FloatArray:
        """
        Return the tool centre point's acceleration at qdd = 0: the Jacobian's rate times `qd`.

        Parameters
        ----------
        q, qd
            Shape (nv,): joint positions [rad or m] and velocities [rad/s or m/s].

        Returns
        -------
        Shape (6,): linear rows first, world axes [m/s^2, rad/s^2].

        Raises
        ------
        ValueError
            If an input has the wrong shape or is not finite.
        """
        position, velocity = self.to_pinocchio(q), finite_vector("qd", qd, self.nv)
        data = self._data
        pin.forwardKinematics(self.model, data, position, velocity, np.zeros(self.nv))
        acceleration = pin.getFrameClassicalAcceleration(
            self.model, data, self._frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        return np.array(acceleration.vector, dtype=np.float64)

    def mass_matrix(self, q: ArrayLike) -> FloatArray:
        """
        Return the joint-space inertia.

        Parameters
        ----------
        q
            Shape (nv,): joint positions [rad or m].

        Returns
        -------
        Shape (nv, nv), symmetric [kg m^2, kg m or kg].

        Raises
        ------
        ValueError
            If `q` has the wrong shape or is not finite.
        RobotError
            If the robot's masses are not known.
        """
        self._need_inertia("mass_matrix")
        data = self._data
        upper = np.triu(pin.crba(self.model, data, self.to_pinocchio(q)))
        return np.asarray(upper + np.triu(upper, 1).T, dtype=np.float64)

    def bias_forces(self, q: ArrayLike, qd: ArrayLike) -> FloatArray:
        """
        Return the joint forces that hold qdd at 0: Coriolis, centrifugal and gravity.

        Parameters
        ----------
        q, qd
            Shape (nv,): joint positions [rad or m] and velocities [rad/s or m/s].

        Returns
        -------
        Shape (nv,) [Nm or N].

        Raises
        ------
        ValueError
            If an input has the wrong shape or is not finite.
        RobotError
            If the robot's masses are not known.
        """
        self._need_inertia("bias_forces")
        position, velocity = self.to_pinocchio(q), finite_vector("qd", qd, self.nv)
        data = self._data
        return np.array(pin.nonLinearEffects(self.model, data, position, velocity), dtype=np.float64)

    def random_configuration(self, rng: np.random.Generator) -> FloatArray:
        """
        Draw joint positions uniformly within the limits, and within [-pi, pi] for a continuous joint.

        Parameters
        ----------
        rng
            Source of randomness; its state advances.

        Returns
        -------
        Shape (nv,) [rad or m].
        """
        low = np.where(np.isfinite(self.q_min), self.q_min, -np.pi)
        high = np.where(np.isfinite(self.q_max), self.q_max, np.pi)
        return rng.uniform(low, high)

    def symbolic(self, q: ca.SX, qd: ca.SX | None = None) -> SymbolicKinematics:
        """
        Return kinematics and dynamics as CasADi expressions of the given symbols.

        Parameters
        ----------
        q
            `casadi.SX` of shape (nv, 1): joint positions [rad or m].
        qd
            The same for joint velocities [rad/s or m/s]; needed for `jdot_qd` and `bias_forces` only.

        Returns
        -------
        Expressions, each computed when first read.

        Raises
        ------
        RobotError
            If an input is not an SX of shape (nv, 1).
        """
        check_symbol("q", q, self.nv)
        if qd is not None:
            check_symbol("qd", qd, self.nv)
        return SymbolicKinematics(self._chain, self.has_inertia, q, qd)

    @cached_property
    def _buffers(self) -> threading.local:
        return threading.local()

    @property
    def _data(self) -> Any:
        """The calling thread's `pin.Data`; every algorithm used here overwrites what it reads."""
        buffers = self._buffers
        if not hasattr(buffers, "data"):
            buffers.data = self.model.createData()
        return buffers.data

    @cached_property
    def _frame(self) -> int:
        return int(self.model.getFrameId(self.tip, pin.FrameType.BODY))

    @cached_property
    def _chain(self) -> Chain:
        return build_chain(self.model, self._frame)

    @cached_property
    def _places(self) -> JointPlaces:
        return joint_places(self.model)

    def _need_inertia(self, wanted: str) -> None:
        if not self.has_inertia:
            raise RobotError(no_inertia_message(wanted))
