"""Inputs for any formulation, also for those that ask for more than a state and a hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from kinqp.formulations import Lowered
    from tests.formulations.reference import Array

# Scaled, they would describe another arm or cross one another.
_KEPT = ("q_min", "q_max", "dt")


def inputs_at(lowered: Lowered, q: Array, rng: np.random.Generator, speed: float = 0.3) -> dict[str, Array]:
    """Draw a hand, and a small value for every other input without a default."""
    given: dict[str, Array] = {}
    for spec in lowered.inputs:
        if spec.name == "q":
            given["q"] = q
        elif spec.name == "v":
            given["v"] = speed * rng.normal(size=spec.size)
        elif spec.default is None:
            given[spec.name] = np.maximum(0.05 * rng.normal(size=spec.size), spec.lowest)
    return given


def varied(lowered: Lowered, q: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Draw the same, and scale what has a default by up to a tenth, so that nothing is only right for defaults."""
    given = inputs_at(lowered, q, rng)
    for spec in lowered.inputs:
        if spec.name not in given and spec.default is not None and spec.name not in _KEPT:
            given[spec.name] = spec.default * rng.uniform(0.9, 1.1, spec.size)
    return given
