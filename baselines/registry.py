"""The baselines, by name."""

from __future__ import annotations

import inspect
from typing import Final

from ..solvers.plugins import PluginError, Registry
from .base import Baseline
from .geometric_clamping import GeometricClamping
from .geometric_scaling import GeometricScaling
from .gradient_projection import GradientProjection
from .null_space_compensation import NullSpaceCompensation
from .progressive_clamping import ProgressiveClamping
from .saturation_null_space import SaturationNullSpace
from .task_augmentation import TaskAugmentation
from .task_priority import TaskPriority
from .weighted_least_norm import WeightedLeastNorm

_REGISTRY: Final = Registry(
    "baseline",
    "kinqp.baselines",
    Baseline,  # type: ignore[type-abstract]  # only instances of it are made and checked
    {
        cls.name: cls
        for cls in (
            GeometricClamping,
            GeometricScaling,
            GradientProjection,
            NullSpaceCompensation,
            ProgressiveClamping,
            SaturationNullSpace,
            TaskAugmentation,
            TaskPriority,
            WeightedLeastNorm,
        )
    },
)


def available_baselines() -> tuple[str, ...]:
    """Names of the baselines: the library's own and those of installed packages, sorted."""
    return _REGISTRY.names()


def get_baseline(baseline: str | Baseline, /, **options: object) -> Baseline:
    """Find a baseline.

    Parameters
    ----------
    baseline : str or Baseline
        A registered name or ``module:Name``, options in brackets behind it: "saturation-null-space(variant=optimal)";
        or an instance, which is returned as it is.
    **options
        Its options, where it is given by name.

    Raises
    ------
    PluginError
        When there is none of that name, or options come with an instance.
    """
    return _REGISTRY.get(baseline, **options)


def is_baseline(text: str) -> bool:
    """Whether a text as written for `make_step`, options and all, names a baseline: a registered one, or a class."""
    name = text.partition("(")[0].strip()
    if ":" not in name:
        return name in _REGISTRY.names()
    try:
        found = _REGISTRY.find(name)
    except PluginError:
        return False  # whoever looks for it next says what is wrong
    return inspect.isclass(found) and issubclass(found, Baseline)
