"""The one finite-difference helper that every derivative in the tests is judged by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


def difference_jacobian(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    x: NDArray[np.float64],
    step: float = 1e-3,
) -> NDArray[np.float64]:
    """
    Return the derivative of `function` at `x` by central differences of fourth order.

    With entries of order one the error is near 1e-12: step**4 / 30 from truncation, 1e-16 / step from
    rounding.

    Parameters
    ----------
    function
        Takes shape (n,), returns an array of any shape.
    x
        Shape (n,).
    step
        Distance between the points.

    Returns
    -------
    Shape (*function(x).shape, n).
    """
    columns = []
    for i in range(x.size):
        unit = np.zeros_like(x)
        unit[i] = step
        near = function(x + unit) - function(x - unit)
        far = function(x + 2.0 * unit) - function(x - 2.0 * unit)
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.stack(columns, axis=-1)
