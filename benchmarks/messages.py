"""What worker processes are asked and what they answer; in a module of its own, so that both ends name it the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .cells import Block, Cell
    from .config import SweepConfig
    from .store import Part


@dataclass(frozen=True)
class Prepare:
    """Make a block ready; answered by its problems, as `Problems.to_bytes` writes them, where they are wanted."""

    block: Block
    config: SweepConfig
    problems: bool


@dataclass(frozen=True)
class Run:
    """Run a cell of a block that is ready; answered by `Ran`."""

    cell: Cell


@dataclass(frozen=True)
class Time:
    """Time cells of a block; answered by any number of `Visiting`, `Begun` and `Ran`, then None."""

    problems: bytes
    cells: tuple[Cell, ...]
    config: SweepConfig
    core: int | None
    begun: bytes | None = None


@dataclass(frozen=True)
class Begun:
    """What a block has come to, as `kinqp.benchmarks.begun` writes it; to be kept, and answered by anything."""

    content: bytes


@dataclass(frozen=True)
class Visiting:
    """What is being timed."""

    cell: Cell
    repeat: int


@dataclass(frozen=True)
class Ran:
    """How a cell ended: a Parquet file, or none."""

    cell: Cell
    frame: bytes | None
    part: Part


@dataclass(frozen=True)
class Refused:
    """What was asked for raised an exception."""

    reason: str
