"""What a results folder says of its sweep: manifest.json, and how its JSON is read back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from .cells import Cell
from .config import SweepConfig
from .reading import StoreError, broken, read_object

if TYPE_CHECKING:
    from pathlib import Path

FORMAT: Final = 2
_ANEW: Final = "take it from a copy, or begin the sweep anew with --overwrite"


@dataclass(frozen=True)
class Manifest:
    """What was asked for, and under which conditions it was measured.

    Attributes
    ----------
    config : SweepConfig
    conditions : dict of str to str
        Machine, versions, git revision, date.
    cells : tuple of Cell
        All that the sweep consists of, done or not.
    skipped : dict of str to str
        What the configuration names and is not a cell, and why.
    """

    config: SweepConfig
    conditions: dict[str, str]
    cells: tuple[Cell, ...]
    skipped: dict[str, str] = field(default_factory=dict)


def read_manifest(path: Path) -> Manifest:
    """Read a manifest.

    Raises
    ------
    OSError
        When there is none.
    StoreError
        When it is broken.
    """
    read = read_object(path, _ANEW)
    if read.get("format") != FORMAT:
        raise StoreError(f"{path}: expected format {FORMAT}, got {read.get('format')!r}")
    try:
        # Checked when it was written. Here it need not name what is installed: results are read elsewhere, too.
        config = SweepConfig.model_construct(**tuples(read["config"]))
        cells = tuple(_cell(cell) for cell in read["cells"])
        return Manifest(config, _words(read["conditions"]), cells, _words(read["skipped"]))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise broken(path, "the manifest of a sweep", f"{type(error).__name__}: {error}", _ANEW) from error


def tuples(read: dict[str, Any]) -> dict[str, Any]:
    """Turn JSON's lists back into tuples, and further products into what they were."""
    from .config import Product

    made: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in read.items()}
    if "more" in made:
        made["more"] = tuple(Product.model_construct(**tuples(product)) for product in made["more"])
    return made


def _cell(read: dict[str, Any]) -> Cell:
    return Cell(**_words(read))


def _words(read: dict[str, Any]) -> dict[str, str]:
    if not all(isinstance(value, str) for value in read.values()):
        raise TypeError(f"expected words only, got {read}")
    return dict(read)
