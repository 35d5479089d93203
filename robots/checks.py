"""Checks of numeric input, shared by every package above this one."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray: TypeAlias = NDArray[np.float64]


def real_array(name: str, value: ArrayLike, error: type[ValueError] = ValueError) -> FloatArray:
    """
    Return `value` as a float64 array if it holds nothing but real numbers.

    NumPy makes numbers of much that is none: of truth values, of words, of the data under a mask, of the real part of a
    complex number. None of these is meant as a joint value; whoever passes one has made a mistake.

    Parameters
    ----------
    name
        What the caller calls this input; the error starts with it.
    value
        Floats or integers, as an array, a scalar or nested sequences.
    error
        What to raise.

    Returns
    -------
    An array of any shape, infinite and NaN entries included; `value` itself where it is one of float64.

    Raises
    ------
    ValueError
        Or what `error` says, if an entry is not a real number.
    """
    try:
        array = np.asarray(value)
    except (ValueError, TypeError) as mistake:
        raise error(f"{name}: expected real numbers, got {value!r} ({mistake})") from mistake
    kind = _none_number(value) or ("" if array.dtype.kind in "fiu" else str(array.dtype))
    if kind:
        raise error(f"{name}: expected real numbers, got entries of type {kind}")
    return np.asarray(array, dtype=np.float64)


def _none_number(value: object) -> str:
    """Say what of a value NumPy would take for a number beside others, though it is none; empty: nothing."""
    if isinstance(value, np.ma.MaskedArray):
        return "masked"
    if isinstance(value, bool | np.bool_):
        return "bool"
    return next(filter(None, map(_none_number, value)), "") if isinstance(value, list | tuple) else ""


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
    array = real_array(name, value)
    if array.shape != (size,):
        raise ValueError(f"{name}: expected shape ({size},), got {array.shape}")
    finite = np.isfinite(array)
    if not finite.all():
        index = int(np.argmin(finite))
        raise ValueError(f"{name}: expected finite numbers, got {float(array[index])} at index {index}")
    return array.copy()


def read_only(value: ArrayLike) -> FloatArray:
    """Return a float64 copy of `value` that cannot be written to."""
    array = np.array(value, dtype=np.float64)
    array.flags.writeable = False
    return array
