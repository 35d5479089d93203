"""Checks of numeric input, shared by every package above this one."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray: TypeAlias = NDArray[np.float64]


def finite_vector(name: str, value: ArrayLike, size: int) -> FloatArray:
    """
    Return `value` as a new float64 vector, or say what is wrong with it.

    Parameters
    ----------
    name
        What the caller calls this input; the error starts with it.
    value
        Anything NumPy reads as a vector of real numbers.
    size
        Number of entries wanted.

    Returns
    -------
    Shape (size,), a copy.

    Raises
    ------
    ValueError
        If the shape is not `(size,)`, or an entry is not a finite real number.
    """
    try:
        array = np.asarray(value)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name}: expected {size} numbers, got {value!r} ({error})") from error
    # Booleans, strings and complex numbers would pass through float64 or fail late; none of them is a joint
    # value.
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name}: expected real numbers, got entries of type {array.dtype}")
    if array.shape != (size,):
        raise ValueError(f"{name}: expected shape ({size},), got {array.shape}")
    finite = np.isfinite(array)
    if not finite.all():
        index = int(np.argmin(finite))
        raise ValueError(f"{name}: expected finite numbers, got {float(array[index])} at index {index}")
    return array.astype(np.float64)


def read_only(value: ArrayLike) -> FloatArray:
    """Return a float64 copy of `value` that cannot be written to."""
    array = np.array(value, dtype=np.float64)
    array.flags.writeable = False
    return array
