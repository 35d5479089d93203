"""Numbers as people read them."""

from __future__ import annotations

from typing import Final

import numpy as np

#: What stands where there is no number.
NOTHING: Final = "\N{EN DASH}"


def number(value: float | None) -> str:
    """Three digits, without an exponent where that reads better."""
    if value is None:
        return NOTHING
    if value == round(value) and abs(value) < 1e3:
        return f"{value:.0f}"
    if not 1e-3 <= abs(value) < 1e7:
        return f"{value:.2e}"
    if abs(value) >= 1e4:
        return f"{float(f'{value:.2e}'):,.0f}"
    digits = max(0, 2 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{digits}f}"


def two_decimals(value: float | None) -> str:
    """Two decimals, as the thesis prints chi-squared."""
    return NOTHING if value is None else f"{value:.2f}"


def p_value(value: float | None) -> str:
    """A p-value in two digits."""
    if value is None:
        return NOTHING
    return f"{value:.1e}" if value < 1e-3 else f"{value:.2g}"


def count(value: int, singular: str) -> str:
    """A count with its noun, in the plural where it is not one."""
    return f"{value} {singular}" if value == 1 else f"{value} {singular}s"
