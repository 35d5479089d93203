"""Replaying recorded QPs in C: no Python within the measured span."""

from .replay import CReplay, c_replay

__all__ = ["CReplay", "c_replay"]
