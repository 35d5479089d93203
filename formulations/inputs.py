"""Checks of a step's run-time inputs: every mistake is one sentence that names the input."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from .modes import Mode
    from .tick_inputs import Input

    Array = NDArray[np.float64]


class InputError(ValueError):
    """A run-time input of a step has the wrong shape, size or value; the message names it."""


def check_input(spec: Input, given: ArrayLike, mode: Mode) -> Array:
    """Return an input's value as float64, shape (size,) or, where it has a default, () for all entries alike.

    Raises
    ------
    InputError
        Naming the input, what was expected and what was got.
    """
    try:
        value = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{spec.name}: expected {describe_input(spec, mode)}, got {given!r}") from None
    if value.shape != (spec.size,) and not (spec.default is not None and value.ndim == 0):
        raise InputError(f"{spec.name}: expected {describe_input(spec, mode)}, got shape {value.shape}")
    if np.isnan(value).any() or (np.isinf(value).any() and not spec.may_be_infinite):
        raise InputError(f"{spec.name}: expected finite numbers, got {value}")
    if not spec.admits(value):
        raise InputError(f"{spec.name}: expected {spec.describe_range()}, got {value}")
    return value


def describe_input(spec: Input, mode: Mode) -> str:
    """Say what an input must look like."""
    if spec.name == "v":
        return f"shape ({spec.size},) for mode {mode} (rows {', '.join(mode.free_names)})"
    return f"shape ({spec.size},) [{spec.unit}]"


def complete_inputs(specs: Sequence[Input], given: Mapping[str, ArrayLike], mode: Mode) -> dict[str, Array]:
    """Check what was given of a step's inputs and add the defaults of the rest; by name, shapes (size,).

    Raises
    ------
    InputError
        Naming an input that is unknown, missing, of the wrong size, not finite or out of its range.
    """
    known = {spec.name: spec for spec in specs}
    for name in given:
        if name not in known:
            raise InputError(f"{name}: expected an input among {', '.join(known)}, got {name!r}")
    values: dict[str, Array] = {}
    for name, spec in known.items():
        if name in given:
            value = check_input(spec, given[name], mode)
            values[name] = value if value.ndim else np.full(spec.size, value)
        elif spec.default is not None:
            values[name] = spec.default
        else:
            raise InputError(f"{name}: expected {describe_input(spec, mode)}, got nothing")
    # The defaults are in order.
    limited = ("q_min" in given or "q_max" in given) and {"q_min", "q_max"} <= values.keys()
    if limited and (values["q_min"] > values["q_max"]).any():
        low, high = values["q_min"], values["q_max"]
        raise InputError(f"q_min and q_max: expected q_min <= q_max at every joint, got {low} and {high}")
    return values
