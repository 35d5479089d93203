"""The formulations, by name."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from ..solvers.plugins import Registry
from .base import Formulation
from .cartesian_error import CartesianError
from .cartesian_error_acceleration import CartesianErrorAcceleration
from .cartesian_error_robust import CartesianErrorRobust
from .constraints import Constrained, get_constraint
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

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .constraints import Constraint

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


# A plus between terms, not one of an exponent within brackets.
_BETWEEN: Final = re.compile(r"\+(?![^(]*\))")


def available_formulations() -> tuple[str, ...]:
    """Names of the formulations: the library's own and those of installed packages, sorted."""
    return _REGISTRY.names()


def get_formulation(formulation: str | Formulation, /, **options: object) -> Formulation:
    """Find a formulation.

    Parameters
    ----------
    formulation : str or Formulation
        A registered name or ``module:Name``, options in brackets behind it: "cartesian-error(bounds=thesis)"; or an
        instance, which is returned as it is. Constraints may follow: "joint-space + twist-limits(frame=tool)".
    **options
        Its options, where it is given by name.

    Raises
    ------
    PluginError
        When there is none of that name, or options come with an instance.
    """
    if not isinstance(formulation, str):
        return _REGISTRY.get(formulation, **options)
    name, *constraints = _BETWEEN.split(formulation)
    made = _REGISTRY.make(name, **options)
    return with_constraints(made, constraints) if constraints else made


def with_constraints(formulation: str | Formulation, constraints: Sequence[str | Constraint]) -> Constrained:
    """Put constraints on a formulation's command.

    Parameters
    ----------
    formulation : str or Formulation
        As for `get_formulation`.
    constraints : sequence of str or Constraint
        Each as for `kinqp.formulations.constraints.get_constraint`.

    Returns
    -------
    Constrained
        A formulation like any other: for `make_step`, `compile_step`, `export_c`, a sweep. In text it is
        "joint-space + self-collision + twist-limits(frame=tool)".

    Raises
    ------
    PluginError
        When there is no formulation or constraint of a name.
    ValueError
        When two constraints have one name.
    """
    return Constrained(
        formulation=get_formulation(formulation), constraints=tuple(get_constraint(one) for one in constraints)
    )
