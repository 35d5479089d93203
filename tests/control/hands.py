"""Hands for tests of the guiding controller."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray


class Pull:
    """A hand that pulls by a function of time, pose and twist, and never ends the run."""

    def __init__(self, function: Callable[..., ArrayLike]) -> None:
        self.function = function

    def wrench(self, t: float, pose: NDArray[np.float64], twist: NDArray[np.float64]) -> NDArray[np.float64]:
        """As in `Hand`."""
        return np.asarray(self.function(t, pose, twist), dtype=float)

    def finished(self, _t: float) -> bool:
        """As in `Hand`."""
        return False

    def reset(self) -> None:
        """As in `Hand`."""


def constant(*wrench: float) -> Pull:
    """A hand that always pulls alike."""
    return Pull(lambda *_: wrench)


def smooth(*wrench: float, rise: float = 0.5) -> Pull:
    """A hand whose pull grows smoothly from nothing within `rise` [s]."""

    def pull(t: float, *_: object) -> NDArray[np.float64]:
        x = min(t / rise, 1.0)
        return np.array(wrench) * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)

    return Pull(pull)
