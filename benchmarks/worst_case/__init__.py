"""Worst case of a compiled tick: the state with most iterations, the slowest one, and how to see them again."""

from .case import CaseError, Found, Replayed, WorstCase, read_case, replay, write_case
from .search import search
from .states import Batch

__all__ = [
    "Batch",
    "CaseError",
    "Found",
    "Replayed",
    "WorstCase",
    "read_case",
    "replay",
    "search",
    "write_case",
]
