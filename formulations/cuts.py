"""Quantities of a tick that generated C computes by a kernel written for it instead of by their formula.

A formula is straight-line code: every choice in it is computed both ways, and nothing is a loop. A kernel may branch
and loop over joints. In a tick that is lowered for C each such quantity is a symbol, a cut through the expression
graph, and the tick remembers what kernel fills it in from what.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Cut:
    """One call of a kernel.

    Attributes
    ----------
    kernel : str
        Name of the C function, without the library's prefix.
    sizes : tuple of int
        Its leading arguments, constants of the generated code.
    inputs : tuple of ca.SX
        What it reads: expressions of the tick's inputs and of the symbols of earlier cuts.
    symbols : tuple of ca.SX
        What stands for its results in expressions behind it.
    formulas : tuple of ca.SX
        The same results as expressions of `inputs`; what the kernel has to agree with.
    """

    kernel: str
    sizes: tuple[int, ...]
    inputs: tuple[ca.SX, ...]
    symbols: tuple[ca.SX, ...]
    formulas: tuple[ca.SX, ...]


def make_cut(kernel: str, sizes: tuple[int, ...], inputs: tuple[ca.SX, ...], formulas: tuple[ca.SX, ...]) -> Cut:
    """Make a cut with symbols of its own, one for each entry of each result."""
    symbols = tuple(ca.SX.sym(f"{kernel}_{k}", *formula.shape) for k, formula in enumerate(formulas))
    return Cut(kernel, sizes, inputs, symbols, formulas)
