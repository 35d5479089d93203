"""A symbolic function evaluated on arrays that stay where they are: what a control cycle in Python can afford."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import casadi as ca
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class BufferedFunction:
    """Evaluates expressions in place: write into `given`, call, read from `results`.

    Not to be shared between threads: it owns the arrays that it works on.

    Parameters
    ----------
    name : str
        For messages.
    arguments : mapping of str to ca.SX
        Symbols by name, columns.
    expressions : mapping of str to ca.SX
        What to evaluate, by name.

    Attributes
    ----------
    given : dict of str to ndarray
        Values of the arguments, shapes (size,).
    results : dict of str to ndarray
        Values of the expressions, in their shapes; overwritten by the next call.
    """

    def __init__(self, name: str, arguments: Mapping[str, ca.SX], expressions: Mapping[str, ca.SX]) -> None:
        # CasADi writes column by column, NumPy reads row by row: hence the transposes.
        function = ca.Function(
            name, list(arguments.values()), [ca.densify(ca.SX(value).T) for value in expressions.values()]
        )
        # The pair must be kept together: the buffer owns what the call works on.
        self._buffer, self._evaluate = function.buffer()
        self.given: Final = {label: np.zeros(symbol.size1()) for label, symbol in arguments.items()}
        self.results: Final = {label: np.zeros(value.shape) for label, value in expressions.items()}
        for index, values in enumerate(self.given.values()):
            self._buffer.set_arg(index, memoryview(values))  # type: ignore[arg-type,call-arg]  # CasADi's stubs give the C++ signature
        for index, matrix in enumerate(self.results.values()):
            self._buffer.set_res(index, memoryview(matrix.reshape(-1)))  # type: ignore[arg-type,call-arg]  # as above

    def __call__(self) -> None:
        """Evaluate at what `given` holds."""
        self._evaluate()

    def copies(self) -> dict[str, Array]:
        """Evaluate, and return the results as arrays of their own."""
        self._evaluate()
        return {label: matrix.copy() for label, matrix in self.results.items()}
