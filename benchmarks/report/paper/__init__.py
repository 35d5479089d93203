"""Figures fit for a paper: PNG and SVG, two columns wide."""

from .selection import Selection
from .write import write_figures

__all__ = ["Selection", "write_figures"]
