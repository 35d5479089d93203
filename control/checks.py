"""Checks that every controller makes of what it is given."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..formulations import LONGEST_DT, SHORTEST_DT, InputError, Mode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]


def checked_array(name: str, given: ArrayLike, size: int, *, finite: bool = True) -> Array:
    """Return `given` as an array of shape (size,), finite unless told that it need not be.

    Raises
    ------
    InputError
        Naming it, what was expected and what was got.
    """
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected {size} numbers, got {given!r}") from None
    if values.shape != (size,):
        raise InputError(f"{name}: expected shape ({size},), got {values.shape}")
    if finite and not np.isfinite(values).all():
        raise InputError(f"{name}: expected finite numbers, got {values}")
    return values


def checked_modes(modes: Sequence[str | Mode]) -> tuple[Mode, ...]:
    """Return the motion modes of a controller, parsed.

    Raises
    ------
    ModeError
        When one is not known.
    ValueError
        When there are none, or one is given twice.
    """
    parsed = tuple(Mode.parse(mode) if isinstance(mode, str) else mode for mode in modes)
    texts = [str(mode) for mode in parsed]
    if not texts or len(set(texts)) < len(texts):
        raise ValueError(f"modes: expected at least one, each once, got {', '.join(texts) or 'none'}")
    return parsed


def checked_period(dt: float) -> float:
    """Return a control period [s].

    Raises
    ------
    ValueError
        When it is none.
    """
    if not SHORTEST_DT <= dt <= LONGEST_DT:
        raise ValueError(f"dt: expected {SHORTEST_DT:g} to {LONGEST_DT:g} s, got {dt}")
    return float(dt)
