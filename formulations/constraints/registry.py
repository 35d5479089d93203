"""The constraints, by name."""

from __future__ import annotations

from typing import Final

from ...solvers.plugins import Registry
from .base import Constraint
from .contact_force import ContactForce
from .elbow import ElbowBend, ElbowHold, ElbowRange
from .obstacles import Obstacles
from .remote_centre import RemoteCentre
from .self_collision import SelfCollision
from .singularity import SingularityAvoidance
from .twist_limits import TwistLimits

_REGISTRY: Final = Registry(
    "constraint",
    "kinqp.constraints",
    Constraint,  # type: ignore[type-abstract]  # only instances of it are made and checked
    {
        cls.kind: cls
        for cls in (
            ContactForce,
            ElbowBend,
            ElbowHold,
            ElbowRange,
            Obstacles,
            RemoteCentre,
            SelfCollision,
            SingularityAvoidance,
            TwistLimits,
        )
    },
)


def available_constraints() -> tuple[str, ...]:
    """Names of the constraints: the library's own and those of installed packages, sorted."""
    return _REGISTRY.names()


def get_constraint(constraint: str | Constraint, /, **options: object) -> Constraint:
    """Find a constraint.

    Parameters
    ----------
    constraint : str or Constraint
        A registered name or ``module:Name``, options in brackets behind it: "twist-limits(frame=tool)"; or an instance,
        which is returned as it is.
    **options
        Its options, where it is given by name.

    Raises
    ------
    PluginError
        When there is none of that name, or options come with an instance.
    """
    return _REGISTRY.get(constraint, **options)
