"""The formulations, by name."""

from __future__ import annotations

from typing import Final

from ..solvers.plugins import PluginError, Registry
from .base import Formulation
from .cartesian_error import CartesianError
from .cartesian_error_acceleration import CartesianErrorAcceleration
from .cartesian_error_robust import CartesianErrorRobust
from .damped import Damped
from .hierarchical import Hierarchical
from .joint_space import JointSpace
from .joint_space_acceleration import JointSpaceAcceleration
from .joint_space_robust import JointSpaceRobust
from .joint_space_weighted import JointSpaceWeighted
from .minimum_acceleration_norm import MinimumAccelerationNorm
from .minimum_kinetic_energy import MinimumKineticEnergy
from .minimum_torque_norm import MinimumTorqueNorm
from .minimum_velocity_norm import MinimumVelocityNorm
from .task_scaling import TaskScaling

_REGISTRY: Final = Registry(
    "formulation",
    "kinqp.formulations",
    Formulation,  # type: ignore[type-abstract]  # only instances of it are made and checked
    {
        cls.name: cls
        for cls in (
            CartesianError,
            CartesianErrorAcceleration,
            CartesianErrorRobust,
            Damped,
            Hierarchical,
            JointSpace,
            JointSpaceAcceleration,
            JointSpaceRobust,
            JointSpaceWeighted,
            MinimumAccelerationNorm,
            MinimumKineticEnergy,
            MinimumTorqueNorm,
            MinimumVelocityNorm,
            TaskScaling,
        )
    },
)


def available_formulations() -> tuple[str, ...]:
    """Names of the formulations: the library's own and those of installed packages, sorted."""
    return _REGISTRY.names()


def get_formulation(formulation: str | Formulation, /, **options: object) -> Formulation:
    """Find a formulation.

    Parameters
    ----------
    formulation : str or Formulation
        A registered name or ``module:Name``, options in brackets behind it: "cartesian-error(bounds=thesis)"; or an
        instance, which is returned as it is.
    **options
        Its options, where it is given by name.

    Raises
    ------
    PluginError
        When there is none of that name, or options come with an instance.
    """
    if isinstance(formulation, str):
        return _REGISTRY.make(formulation, **options)
    if options:
        raise PluginError(f"formulation: expected no options with an instance, got {', '.join(options)}")
    return formulation
