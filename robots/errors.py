"""The error raised for a robot that cannot be found, read or used."""

from __future__ import annotations


class RobotError(ValueError):
    """One sentence: which input, what was expected, what was got, and what to do next."""
