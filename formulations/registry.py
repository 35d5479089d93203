"""The formulations, by name."""

from __future__ import annotations

from typing import Final

from ..solvers.plugins import PluginError, Registry
from .base import Formulation
from .cartesian_error import CartesianError
from .cartesian_error_robust import CartesianErrorRobust
from .joint_space import JointSpace
from .joint_space_robust import JointSpaceRobust

_REGISTRY: Final = Registry(
    "formulation",
    "kinqp.formulations",
    Formulation,  # type: ignore[type-abstract]  # only instances of it are made and checked
    {cls.name: cls for cls in (CartesianError, CartesianErrorRobust, JointSpace, JointSpaceRobust)},
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
