"""Numbers in JSON, which knows no infinity."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


def with_words(values: Iterable[float]) -> list[float | str]:
    """Numbers, those that aren't finite as the words that `float` reads back as they were."""
    return [x if isfinite(x) else str(x) for x in values]
