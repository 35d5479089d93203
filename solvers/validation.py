"""Checks of the data of a QP; every failure is one sentence that names the input."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]

#: Largest accepted asymmetry of H, relative to its largest entry. Products such as J'WJ are symmetric to
#: about 1e-16; anything near this limit is a wrong matrix, not rounding.
SYMMETRY_TOLERANCE = 1e-10

#: Most negative accepted eigenvalue of H, relative to the largest one in magnitude (same reasoning).
CONVEXITY_TOLERANCE = 1e-10

#: The same where H comes in single precision, whose products are symmetric to about 1e-7.
SINGLE_TOLERANCE = 1e-5

#: By how much a lower bound may exceed its upper bound, relative to the two: rounding, which makes them one.
CROSSING_TOLERANCE = 1e-14


class QPError(ValueError):
    """A quadratic program was given data that do not describe one."""


def to_array(name: str, value: npt.ArrayLike) -> Array:
    """Copy real numbers into a float64, C-contiguous array."""
    if hasattr(value, "toarray"):
        raise QPError(f"{name} must be a dense array, but is a sparse {type(value).__name__}: give {name}.toarray().")
    try:
        raw = np.asarray(value)
        # NumPy would drop the imaginary part with no more than a warning.
        if not np.iscomplexobj(raw):
            return np.array(raw, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise QPError(f"{name} must be an array of real numbers, but conversion failed with: {error}.") from error
    raise QPError(f"{name} must be an array of real numbers, but holds complex ones.")


def to_matrix(name: str, value: npt.ArrayLike | None, n: int) -> Array:
    """Copy a finite matrix with n columns; None and an empty list have no rows."""
    if value is None:
        return np.empty((0, n))
    array = to_array(name, value)
    if array.shape == (0,):
        return np.empty((0, n))
    if array.ndim != 2 or array.shape[1] != n:
        raise QPError(f"{name} must have shape (rows, {n}), one column per variable, but has shape {array.shape}.")
    require_finite(name, array)
    return array


def to_vector(name: str, value: npt.ArrayLike, size: int, meaning: str) -> Array:
    """Copy a finite vector."""
    array = to_array(name, value)
    require_size(name, array, size, meaning)
    require_finite(name, array)
    return array


def to_bound(name: str, value: npt.ArrayLike | None, size: int, meaning: str, absent: float) -> Array:
    """Copy bounds, where the infinity `absent` is allowed and None is all absent."""
    if value is None:
        return np.full(size, absent)
    array = to_array(name, value)
    require_size(name, array, size, meaning)
    wrong = np.isnan(array) | (array == -absent)
    if wrong.any():
        i = int(np.argmax(wrong))
        raise QPError(f"{name} must hold numbers or {absent}, but {name}[{i}] is {array[i]}.")
    return array


def require_size(name: str, array: Array, size: int, meaning: str) -> None:
    """Refuse a vector of another size."""
    if array.shape != (size,):
        raise QPError(f"{name} must have shape ({size},), {meaning}, but has shape {array.shape}.")


def require_finite(name: str, array: Array) -> None:
    """Refuse NaN and infinity."""
    wrong = ~np.isfinite(array)
    if wrong.any():
        index = ", ".join(str(int(i)) for i in np.argwhere(wrong)[0])
        raise QPError(f"{name} must be finite, but {name}[{index}] is {array[wrong][0]}.")


def order_bounds(low_name: str, low: Array, high_name: str, high: Array) -> None:
    """Refuse a lower bound above its upper bound; where it is above by rounding alone, set both to their middle."""
    crossed = low > high
    if not crossed.any():
        return
    wrong = crossed.copy()
    wrong[crossed] = low[crossed] - high[crossed] > CROSSING_TOLERANCE * (abs(low[crossed]) + abs(high[crossed]))
    rounding = crossed & ~wrong
    low[rounding] = high[rounding] = 0.5 * low[rounding] + 0.5 * high[rounding]
    if wrong.any():
        i = int(np.argmax(wrong))
        raise QPError(f"{low_name} must not exceed {high_name}, but {low_name}[{i}] = {low[i]} > {high[i]}.")


def convex(H: Array, *, single: bool = False) -> Array:
    """Return the symmetric part of H after checking that it is all of H and positive semi-definite.

    Parameters
    ----------
    H
        Square and finite, shape (n, n).
    single
        Whether H was computed in single precision. Then its rounding is allowed for, and negative eigenvalues that come
        of it are lifted to zero by a multiple of the identity.

    Raises
    ------
    QPError
        When H is not symmetric or not positive semi-definite, by more than rounding.
    """
    symmetry, convexity = (SINGLE_TOLERANCE,) * 2 if single else (SYMMETRY_TOLERANCE, CONVEXITY_TOLERANCE)
    largest = float(np.abs(H).max())
    asymmetry = float(np.abs(0.5 * H - 0.5 * H.T).max())
    if asymmetry > 0.5 * symmetry * largest:
        precision = 2.0 * asymmetry <= SINGLE_TOLERANCE * largest
        remedy = "; if it was computed in single precision, give it as float32" if precision else ""
        raise QPError(
            f"H must be symmetric, but |H - H'| reaches {2 * asymmetry:.3g} where |H| reaches {largest:.3g}{remedy}."
        )
    symmetric: Array = 0.5 * H + 0.5 * H.T
    eigenvalues = np.linalg.eigvalsh(symmetric)
    size = float(np.abs(eigenvalues).max())
    if eigenvalues[0] < -convexity * size:
        precision = eigenvalues[0] >= -SINGLE_TOLERANCE * size
        remedy = "; if it was computed in single precision, give it as float32" if precision else ""
        raise QPError(f"H must be positive semi-definite, but its smallest eigenvalue is {eigenvalues[0]:.3g}{remedy}.")
    if single and eigenvalues[0] < 0.0:
        symmetric -= 1.01 * eigenvalues[0] * np.eye(len(H))
    return symmetric
